//! `bodyflight unit`.

use std::time::Duration;

use bodyflight::diagnostic::Result;
use bodyflight::interrupt;
use bodyflight::unit::virtual_unit::VirtualUnit;

use super::terminal;

/// Run a unit on this machine behind a pseudo-terminal, until Ctrl-C.
#[derive(clap::Args)]
#[command(after_help = "Prints the terminal to stream to.\n\n\
                        Example: bodyflight unit &  bodyflight stream flight.toml --port /dev/pts/3")]
pub(super) struct Args {}

pub(super) fn run(_: &Args) -> Result<()> {
    let unit = VirtualUnit::start()?;
    terminal::print(&unit.path().display().to_string());
    // Ctrl-C is how it is meant to end.
    while interrupt::check().is_ok() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}
