//! In place of the check of signatures, where it is not built in.

use std::path::Path;

use bodyflight_io::diagnostic::{Problem, Result};

use super::Image;

impl Image {
    /// Says that this program cannot check signatures.
    ///
    /// # Errors
    /// Always returns an error.
    pub fn signed_by(&self, _: &Path) -> Result<String> {
        Err(Problem::not_built_in("the check of signatures"))
    }
}
