//! `bodyflight inspect`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::systems::is_of_another_system;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::inspect::inspect;
use bodyflight_verbs::inspect_imported::inspect_imported;

use super::several::each;
use super::terminal;

/// Describe a recording: format, rate, frames, fields, arm frame, how well its joints close, impossible values, and the
/// first frame as a picture.
#[derive(clap::Args)]
#[command(
    after_help = "Exit code 5: the recording contradicts itself, so that results from it cannot be trusted.\n\nExamples:\n  bodyflight inspect flight.mvnx --subject subject.toml\n  \
                  bodyflight inspect flight.mvnx turn-1/flight.mvnx --json\n  \
                  bodyflight inspect jump.csv --mapping mapping.toml"
)]
pub(super) struct Args {
    /// MVNX files, possibly compressed (.gz, .xz), or files of other systems, as import reads them; - is standard input.
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// A mapping, for files of other systems (docs/import.md).
    #[arg(long, value_name = "TOML")]
    mapping: Option<PathBuf>,
    /// A subject.toml, to compare the recording's centre of mass with that of the model's body.
    #[arg(long, value_name = "TOML")]
    subject: Option<PathBuf>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let subject = args.subject.as_deref().map(Subject::read).transpose()?;
    let mapping = args.mapping.as_deref().map(Mapping::read).transpose()?;
    let body = subject.as_ref().map(Subject::body);
    each(&args.files, json, |file| {
        let spinner = terminal::spinner("reading");
        let report = if mapping.is_some() || is_of_another_system(file) {
            inspect_imported(file, mapping.as_ref(), subject.as_ref())
        } else {
            inspect(file, body.as_ref())
        };
        spinner.finish_and_clear();
        let report = report?;
        if !json {
            terminal::print(report.to_string().trim_end());
        }
        let verdict = match report.doubt() {
            Some(doubt) => Err(Problem::doubt(doubt).in_file(file)),
            None => Ok(()),
        };
        Ok((report, verdict))
    })
}
