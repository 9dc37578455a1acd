//! In place of `bodyflight completions` and `bodyflight man`, where they are not built in.

use std::ffi::OsString;

use bodyflight_io::diagnostic::{Problem, Result};
use clap::Command;

/// Print the completion script for a shell.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight completions bash")]
pub(super) struct Completions {
    /// The shell.
    #[arg(num_args = 0.., allow_hyphen_values = true)]
    shell: Vec<OsString>,
}

/// Write a man page for each verb.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight man --out man1")]
pub(super) struct Man {
    /// Where the pages are written.
    #[arg(num_args = 0.., allow_hyphen_values = true)]
    place: Vec<OsString>,
}

/// Refuses: the command that adds completions is in the message.
pub(super) fn completions(_: &Completions, _: Command) -> Result<()> {
    Err(Problem::not_built_in("completions"))
}

/// Refuses: the command that adds manual pages is in the message.
pub(super) fn man(_: &Man, _: Command, _: bool) -> Result<()> {
    Err(Problem::not_built_in("manual pages"))
}
