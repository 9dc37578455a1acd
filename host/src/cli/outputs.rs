//! Files that a verb writes, looked at before its work.

use std::path::{Path, PathBuf};

use bodyflight::diagnostic::Result;
use bodyflight::output::destination;

/// What is allowed to outputs.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Outputs {
    /// Replace output files that exist.
    #[arg(long)]
    force: bool,
}

impl Outputs {
    /// Checks files, those that were asked for. To be called when all inputs are known: none of them is replaced.
    pub(super) fn check<const N: usize>(self, paths: [&Option<PathBuf>; N]) -> Result<()> {
        destination::check(paths.into_iter().flatten(), self.force)
    }

    /// Checks files of these names in a folder, which may not be there yet.
    pub(super) fn check_in(self, folder: &Path, names: &[&str]) -> Result<()> {
        destination::check_in(folder, names, self.force)
    }
}
