//! In place of a unit's archive, where it is not built in.

use std::path::Path;

use bodyflight_fmi::standard::Standard;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::Flight;

/// Refuses: the command that adds archives is in the message.
pub(super) fn archive(
    _: &Path,
    _: &Flight,
    _: Standard,
    _: [&str; 2],
    _: &[(String, Vec<u8>)],
) -> Result<usize> {
    Err(Problem::not_built_in("co-simulation units"))
}
