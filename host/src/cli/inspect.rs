//! `bodyflight inspect`.

use std::path::PathBuf;

use bodyflight::diagnostic::Result;
use bodyflight::formats::subject::Subject;
use bodyflight::verbs::inspect::inspect;

use super::terminal;

/// Say what a recording holds: format, rate, frames, fields, arm frame, how well its joints close, what cannot be, and
/// the first frame as a picture.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight inspect flight.mvnx --subject subject.toml")]
pub(super) struct Args {
    /// An MVNX file, also packed (.gz, .xz); - is standard input.
    file: PathBuf,
    /// The person, to compare the centre of mass of the recording with that of the model's body.
    #[arg(long, value_name = "TOML")]
    subject: Option<PathBuf>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let subject = args.subject.as_deref().map(Subject::read).transpose()?;
    let body = subject.map(|subject| subject.body());
    let spinner = terminal::spinner("reading");
    let report = inspect(&args.file, body.as_ref());
    spinner.finish_and_clear();
    let report = report?;
    if json {
        return terminal::print_json(&report);
    }
    terminal::print(report.to_string().trim_end());
    Ok(())
}
