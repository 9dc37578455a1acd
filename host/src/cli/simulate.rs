//! `bodyflight simulate`.

use std::path::PathBuf;

use bodyflight::diagnostic::Result;
use bodyflight::formats::flight::{Flight, Start};
use bodyflight::formats::model_file::Effects;
use bodyflight::formats::mvnx::ArmFrame;
use bodyflight::formats::recording::{BadFrames, Options};
use bodyflight::output::plot::comparison_svg;
use bodyflight::verbs::simulate::{RunFile, Simulation, simulate};
use bodyflight_core::dynamics::free_run::Equations;

use super::outputs::{Outputs, Plot};
use super::terminal;

/// Run the model over recorded postures from the first frame and compare it with the measured pelvis.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight simulate flight.toml --out run.csv --plot run.pdf")]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file alone.
    flight: PathBuf,
    /// Write time and all channels, measured and simulated, as CSV.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// Effects to extend the model by: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// Equations of motion, in place of the flight's own.
    #[arg(long, value_enum)]
    equations: Option<EquationsName>,
    /// Where the run takes its first motion from: a fit to the first tenth of a second, or the first frame alone.
    #[arg(long, value_enum, default_value = "smoothed")]
    start: StartName,
    /// Precision of the model; the recording is always read in double.
    #[arg(long, value_enum, default_value = "double")]
    precision: Precision,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

/// How to treat a faulty recording.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Reading {
    /// End at the first bad frame instead of bridging short gaps.
    #[arg(long)]
    strict: bool,
    /// Take a file that ends too early up to its last whole frame.
    #[arg(long)]
    allow_truncated: bool,
    /// Convention of the arms, for files without the points to tell it by.
    #[arg(long, value_enum)]
    arm_frame: Option<ArmFrameName>,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum ArmFrameName {
    /// All orientations are the identity in the T-pose.
    TPose,
    /// The arms have the axes of the International Society of Biomechanics.
    Isb,
}

impl Reading {
    /// Options of the reader.
    pub(super) fn options(self) -> Options {
        Options {
            bad_frames: if self.strict {
                BadFrames::Refuse
            } else {
                BadFrames::Bridge
            },
            allow_truncated: self.allow_truncated,
            arm_frame: self.arm_frame.map(|arms| match arms {
                ArmFrameName::TPose => ArmFrame::TPose,
                ArmFrameName::Isb => ArmFrame::Isb,
            }),
        }
    }
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum StartName {
    /// The first frame alone.
    First,
    /// A fit to the first tenth of a second.
    Smoothed,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum EquationsName {
    /// Exact Newton-Euler with moving limbs.
    Exact,
    /// As printed in the paper, with its low-pass filters.
    AsPublished,
}

#[derive(clap::ValueEnum, Clone, Copy)]
pub(super) enum Precision {
    /// As on the unit.
    Single,
    /// For reference.
    Double,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let mut flight = Flight::read(&args.flight)?;
    match args.equations {
        Some(EquationsName::Exact) => flight.equations = Equations::Exact,
        Some(EquationsName::AsPublished) => flight.equations = Equations::AsPublished,
        None => {}
    }
    flight.start = match args.start {
        StartName::First => Start::First,
        StartName::Smoothed => Start::Smoothed,
    };
    if let Some(model) = &args.model {
        flight.effects = Effects::read(model)?;
    }
    args.outputs.check_with([&args.out], &args.plot)?;
    let simulation = run_flight(&flight, args)?;
    terminal::note_assumed_subject(&flight);
    let title = || format!("{}: free run against measurement", args.flight.display());
    args.plot
        .write(|| comparison_svg(&args.plot.title(title), &simulation.comparison))?;
    if json {
        return terminal::print_json(&simulation.report);
    }
    print_report(&simulation);
    for path in [&args.out, &args.plot.path].into_iter().flatten() {
        terminal::print(&format!("written: {}", path.display()));
    }
    Ok(())
}

fn run_flight(flight: &Flight, args: &Args) -> Result<Simulation> {
    let spinner = terminal::spinner("simulating");
    let mut file = args.out.as_deref().map(RunFile::create).transpose()?;
    let options = args.reading.options();
    let each = |step: &_| file.as_mut().map_or(Ok(()), |file| file.write(step));
    let progress = |time: f64| spinner.set_message(format!("simulating, {time:.0} s"));
    let simulation = match args.precision {
        Precision::Single => simulate::<f32>(flight, options, each, progress),
        Precision::Double => simulate::<f64>(flight, options, each, progress),
    };
    spinner.finish_and_clear();
    let simulation = simulation?;
    if let Some(file) = file {
        file.finish()?;
    }
    Ok(simulation)
}

/// The table of gaps and what is worth knowing beside it.
pub(super) fn print_report(simulation: &Simulation) {
    let report = &simulation.report;
    let columns = [("RMS gap", report.rms), ("amplitude", report.amplitude)];
    terminal::print(&terminal::gap_table(&columns).to_string());
    terminal::print(&format!(
        "{} frames, {:.1} s of flight; {:.0} frames a second, file to table",
        report.frames, report.duration_s, report.steps_per_second
    ));
    if let Some(gnss) = &report.gnss {
        terminal::print(&format!(
            "the track's clock is {:.3} +- {:.3} s ahead of the recording's, its north turned by {:.1} degrees",
            gnss.shift_s,
            gnss.deviation_s,
            gnss.heading_rad.to_degrees()
        ));
    }
    for warning in &report.warnings {
        terminal::note(&format!("warning: {warning}"));
    }
    if let Some(fault) = &simulation.quality.first_fault {
        terminal::print(&format!(
            "{} bad frames were bridged; the first: line {}, frame {}, {}: {}",
            report.bridged_frames, fault.line, fault.index, fault.element, fault.message
        ));
    }
}
