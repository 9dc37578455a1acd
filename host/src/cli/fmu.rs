//! `bodyflight fmu`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_replay::flight::Flight;
use bodyflight_verbs::fmu::{Standard, library, write};

use super::outputs::Outputs;
use super::terminal;

/// Export a skydiver as a co-simulation unit (FMI 2.0 or 3.0) for Simulink, OpenModelica and others.
#[derive(clap::Args)]
#[command(
    after_help = "Inputs are joint angles, muscle input, damping and wind; outputs are motion and loads: see docs/fmu.md.\n\n\
                  Example: bodyflight fmu subject.toml --out skydiver.fmu"
)]
pub(super) struct Args {
    /// A subject.toml, or a flight.toml for its person, air and limb groups.
    subject: PathBuf,
    /// File to write.
    #[arg(long, value_name = "FMU", default_value = "skydiver.fmu")]
    out: PathBuf,
    /// Version of FMI; some programs, such as OpenModelica, read 2.0 only.
    #[arg(long, value_enum, value_name = "VERSION", default_value = "3.0")]
    fmi: Version,
    /// The unit's library for this platform; by default the one beside the program.
    #[arg(long, value_name = "FILE")]
    library: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Version {
    #[value(name = "2.0")]
    Two,
    #[value(name = "3.0")]
    Three,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let flight = Flight::read_person(&args.subject)?;
    let library = library(args.library.as_deref())?;
    args.outputs.check_as(Some(&args.out), "fmu")?;
    let standard = match args.fmi {
        Version::Two => Standard::Two,
        Version::Three => Standard::Three,
    };
    let report = write(&flight, standard, &library, &args.out)?;
    if json {
        return terminal::print_json(&report);
    }
    terminal::note_assumed_subject(&flight);
    terminal::print(&format!(
        "written: {} (FMI {}, {} variables, for {}, {:.1} MB)",
        report.file.display(),
        report.standard,
        report.variables,
        report.platform,
        report.bytes as f64 / 1e6
    ));
    Ok(())
}
