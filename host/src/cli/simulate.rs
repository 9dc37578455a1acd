//! `bodyflight simulate`.

use std::path::{Path, PathBuf};

use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::ArmFrame;
use bodyflight_mvnx::recording::{BadFrames, Options, faults};
use bodyflight_replay::Precision;
use bodyflight_replay::flight::{Flight, Start};
use bodyflight_replay::model_file::Effects;
use bodyflight_verbs::output::plot::comparison_svg;
use bodyflight_verbs::simulate::{Report, RunFile, Simulation, simulate};

use super::outputs::{Outputs, Plot};
use super::several::{each, output_of};
use super::terminal::{self, FlightBar};

/// Simulate a flight from its recorded postures and first frame, and compare it with the measured motion of the pelvis.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bodyflight simulate flight.toml --out run.csv --plot run.pdf\n  \
                  bodyflight simulate turn-1 turn-2 --out {}.csv   ({} is the name of the flight)"
)]
pub(super) struct Args {
    /// flight.toml files, their folders, or MVNX files on their own; each is simulated separately.
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// Write all measured and simulated channels over time as CSV.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// Effects to add to the model: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// Equations of motion, instead of those in flight.toml.
    #[arg(long, value_enum)]
    equations: Option<EquationsName>,
    /// Initial motion: a fit to the first tenth of a second, or the first frame alone, which is noisier.
    #[arg(long, value_enum, default_value = "smoothed")]
    start: StartName,
    /// Floating-point precision of the model; the recording is always read in double precision.
    #[arg(long, value_enum, default_value = "double")]
    precision: PrecisionName,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

/// How to handle a faulty recording.
#[derive(clap::Args, Clone, Copy)]
pub(super) struct Reading {
    /// Stop at the first bad frame instead of bridging short gaps.
    #[arg(long)]
    strict: bool,
    /// Accept a truncated file, up to its last complete frame.
    #[arg(long)]
    allow_truncated: bool,
    /// Convention for the arms, for files that lack the points from which it is detected.
    #[arg(long, value_enum)]
    arm_frame: Option<ArmFrameName>,
}

#[derive(clap::ValueEnum, Clone, Copy)]
enum ArmFrameName {
    /// All orientations are the identity in the T-pose.
    TPose,
    /// The arms use the axes of the International Society of Biomechanics.
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
pub(super) enum PrecisionName {
    /// As on the unit.
    Single,
    /// For reference.
    Double,
}

impl From<PrecisionName> for Precision {
    fn from(name: PrecisionName) -> Self {
        match name {
            PrecisionName::Single => Self::Single,
            PrecisionName::Double => Self::Double,
        }
    }
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    each(&args.flights, json, |path| {
        let report = run_flight(path, args, json)?;
        let verdict = match faults(&report.warnings) {
            Some(doubt) => Err(Problem::doubt(doubt).in_file(path)),
            None => Ok(()),
        };
        Ok((report, verdict))
    })
}

fn run_flight(path: &Path, args: &Args, json: bool) -> Result<Report> {
    let mut flight = Flight::read(path)?;
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
        terminal::note_random(&flight.effects);
    }
    let out = output_of(args.out.as_ref(), path, &args.flights)?;
    let plot = args.plot.of(path, &args.flights)?;
    args.outputs.check_with([&out], &plot)?;
    let simulation = simulated(&flight, args, out.as_deref())?;
    terminal::note_assumed_subject(&flight);
    let title = || format!("{}: free run against measurement", path.display());
    plot.write(|| comparison_svg(&plot.title(title), &simulation.comparison))?;
    if !json {
        print_report(&simulation);
        for path in [&out, &plot.path].into_iter().flatten() {
            terminal::print(&format!("written: {}", path.display()));
        }
    }
    Ok(simulation.report)
}

fn simulated(flight: &Flight, args: &Args, out: Option<&Path>) -> Result<Simulation> {
    let bar = FlightBar::new("simulating", flight);
    let mut file = out.map(RunFile::create).transpose()?;
    let options = args.reading.options();
    let simulation = simulate(
        flight,
        options,
        args.precision.into(),
        &mut |step| file.as_mut().map_or(Ok(()), |file| file.write(step)),
        &mut |time| bar.at(time),
    );
    bar.end();
    let simulation = simulation?;
    if let Some(file) = file {
        file.finish()?;
    }
    Ok(simulation)
}

/// Prints the table of gaps, and remarks on the recording.
pub(super) fn print_report(simulation: &Simulation) {
    let report = &simulation.report;
    let columns = [("RMS gap", report.rms), ("amplitude", report.amplitude)];
    terminal::print(&terminal::gap_table(&columns).to_string());
    terminal::print(&format!(
        "{} frames, {:.1} s of flight; processed {:.0} frames a second",
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
