//! In place of a unit's archive, where it is not built in.

use std::path::Path;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Refuses: the command that adds archives is in the message.
pub(super) fn archive(_: &Path, _: AtomicFile, _: &[(String, Vec<u8>)]) -> Result<AtomicFile> {
    Err(Problem::not_built_in("co-simulation units"))
}
