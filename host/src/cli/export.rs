//! `bodyflight export`.

use std::path::PathBuf;

use bodyflight_io::destination::ending;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::{Flight, name_of};
use bodyflight_replay::model_file::Effects;
use bodyflight_verbs::export::{Format, Report, export};

use super::estimate::MethodName;
use super::outputs::Outputs;
use super::simulate::Reading;
use super::terminal::{self, FlightBar};

/// Write every frame of a flight and its simulation for other programs: poses, velocities, joint angles and loads of
/// each segment.
#[derive(clap::Args)]
#[command(
    after_help = "docs/formats.md lists the columns. Open .mcap files in Foxglove, in a 3D panel that follows simulated/pelvis.\n\n\
                  Exit code 5: the file was written, but recording or estimates cannot be trusted.\n\n\
                  Examples:\n  bodyflight export flight.toml --format parquet\n  \
                  bodyflight export flight.toml --out run.mcap\n  \
                  bodyflight export flight.toml --out run.npz --estimates --method smooth"
)]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file on its own.
    flight: PathBuf,
    /// Kind of file; by default from the extension of --out.
    #[arg(long, value_enum, required_unless_present = "out")]
    format: Option<FormatName>,
    /// File to write; by default named after the flight, in the current folder.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Add estimated inputs and their deviations.
    #[arg(long)]
    estimates: bool,
    /// Filter forward in time as on the unit, or smooth the whole flight.
    #[arg(long, value_enum, requires = "estimates", default_value = "filter")]
    method: MethodName,
    /// Effects to add to the model: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum FormatName {
    /// Columns with units, for pandas, polars, MATLAB.
    Parquet,
    /// Columns as text.
    Csv,
    /// A moving body, for Foxglove.
    Mcap,
    /// Arrays, for NumPy.
    Npz,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let mut flight = Flight::read(&args.flight)?;
    if let Some(model) = &args.model {
        flight.effects = Effects::read(model)?;
        terminal::note_random(&flight.effects);
    }
    let format = args.format.map(|name| match name {
        FormatName::Parquet => Format::Parquet,
        FormatName::Csv => Format::Csv,
        FormatName::Mcap => Format::Mcap,
        FormatName::Npz => Format::Npz,
    });
    // An input that would be lost is what matters most.
    args.outputs.check([&args.out])?;
    let (path, format) = match (&args.out, format) {
        (Some(path), Some(format)) => {
            ending(path, &[format.name()], "a file of this --format")?;
            (path.clone(), format)
        }
        (Some(path), None) => (path.clone(), Format::of(path)?),
        (None, format) => {
            let format = format.unwrap_or(Format::Parquet);
            let name = format!("{}.{}", name_of(&args.flight), format.name());
            let path = PathBuf::from(name);
            args.outputs.check([&Some(path.clone())])?;
            (path, format)
        }
    };
    let estimates = args.estimates.then(|| args.method.method());
    let bar = FlightBar::new("exporting", &flight);
    let mut progress = |time: f64| bar.at(time);
    let options = args.reading.options();
    let report = export(
        &flight,
        options,
        (&path, format),
        estimates,
        &terminal::argument_texts(),
        &mut progress,
    );
    bar.end();
    let report = report?;
    terminal::note_assumed_subject(&flight);
    print_report(&report, json)?;
    match report.doubt {
        None => Ok(()),
        Some(sentence) => Err(Problem::doubt(sentence)
            .in_file(&args.flight)
            .help("the file was written, but do not trust what is in it")),
    }
}

fn print_report(report: &Report, json: bool) -> Result<()> {
    if json {
        return terminal::print_json(report);
    }
    #[expect(clippy::cast_precision_loss, reason = "file sizes are below 2^53")]
    let megabytes = report.bytes as f64 / 1e6;
    terminal::print(&format!(
        "written: {} ({} frames, {:.1} s, {} columns, {megabytes:.1} MB)",
        report.file.display(),
        report.frames,
        report.duration_s,
        report.columns
    ));
    Ok(())
}
