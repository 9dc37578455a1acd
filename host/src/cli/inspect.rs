//! `bodyflight inspect`.

use std::path::PathBuf;

use bodyflight::diagnostic::Result;
use bodyflight::verbs::inspect::inspect;

use super::terminal;

/// Say what a recording holds: format, rate, frames, fields, arm frame and how well its joints close.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight inspect flight.mvnx")]
pub(super) struct Args {
    /// An MVNX file.
    file: PathBuf,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let spinner = terminal::spinner("reading");
    let report = inspect(&args.file);
    spinner.finish_and_clear();
    let report = report?;
    if json {
        return terminal::print_json(&report);
    }
    terminal::print(report.to_string().trim_end());
    Ok(())
}
