//! `bodyflight simulate`.

use std::path::{Path, PathBuf};

use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::ArmFrame;
use bodyflight_mvnx::recording::{BadFrames, Options};
use bodyflight_replay::Precision;
use bodyflight_replay::flight::{Flight, Start};
use bodyflight_replay::joint_change::JointChange;
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::steps::DIVERGED_HELP;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::output::plot::comparison_svg;
use bodyflight_verbs::simulate::pair_file::PairFile;
use bodyflight_verbs::simulate::what_if::{self, Change};
use bodyflight_verbs::simulate::{Report, RunFile, Simulation, simulate};

use super::outputs::{Outputs, Plot};
use super::several::{self, each, output_of};
use super::terminal::{self, FlightBar};

/// Simulate a flight from its recorded postures and first frame, and compare it with the measured motion of the pelvis.
#[derive(clap::Args)]
#[command(
    after_help = "What if: --joint, --subject and --inputs none simulate the flight again with a change, from the same start, and\n\
                  report the difference to the unchanged simulation. Joints are segments, such as l_shank for the left knee;\n\
                  their angles are psi, theta and phi about Z, Y and X, and bend for knees (docs/what-if.md).\n\n\
                  Examples:\n  bodyflight simulate flight.toml --out run.csv --plot run.pdf\n  \
                  bodyflight simulate flight.toml --joint l_shank.bend=+20@1.0..2.5\n  \
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
    /// What if: change a joint by degrees, in a window of seconds or all the time, or by a column of a CSV file; repeatable.
    #[arg(
        long,
        value_name = "JOINT.ANGLE=DEGREES[@FROM..TO]|FILE:COLUMN",
        allow_hyphen_values = true
    )]
    joint: Vec<String>,
    /// What if: another person, a subject.toml.
    #[arg(long, value_name = "TOML")]
    subject: Option<PathBuf>,
    /// What if: without the known conscious inputs of the flight.
    #[arg(long, value_enum)]
    inputs: Option<InputsName>,
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
enum InputsName {
    /// No muscle input, and the subject's damping.
    None,
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
    let change = changes(args)?;
    if !change.is_none() {
        return each(&args.flights, json, |path| {
            let report = run_what_if(path, args, &change, json)?;
            let verdict = verdict(report.doubt(), report.diverged.is_some(), path);
            Ok((report, verdict))
        });
    }
    each(&args.flights, json, |path| {
        let report = run_flight(path, args, json)?;
        let verdict = verdict(report.doubt(), report.diverged.is_some(), path);
        Ok((report, verdict))
    })
}

/// The verdict on a simulation.
fn verdict(doubt: Option<String>, is_diverged: bool, path: &Path) -> Result<()> {
    several::verdict(doubt, path).map_err(|problem| {
        if is_diverged {
            problem.help(DIVERGED_HELP)
        } else {
            problem
        }
    })
}

/// What is to be changed.
fn changes(args: &Args) -> Result<Change> {
    let joints = args.joint.iter().map(|text| JointChange::parse(text));
    Ok(Change {
        joints: joints.collect::<Result<_>>()?,
        subject: args.subject.as_deref().map(Subject::read).transpose()?,
        without_inputs: args.inputs.is_some(),
    })
}

fn run_what_if(path: &Path, args: &Args, change: &Change, json: bool) -> Result<what_if::Report> {
    let flight = flight_of(path, args)?;
    let out = output_of(args.out.as_ref(), path, &args.flights)?;
    let plot = args.plot.of(path, &args.flights)?;
    args.outputs.check_with([&out], &plot)?;
    let bar = FlightBar::new("simulating", &flight);
    let mut file = out.as_deref().map(PairFile::create).transpose()?;
    let simulation = what_if::what_if(
        &flight,
        change,
        args.reading.options(),
        args.precision.into(),
        &mut |steps| file.as_mut().map_or(Ok(()), |file| file.write(steps)),
        &mut |time| bar.at(time),
    );
    bar.end();
    let simulation = simulation?;
    if let Some(file) = file {
        file.finish()?;
    }
    terminal::note_assumed_subject(&flight);
    let title = || format!("{}: unchanged and changed", path.display());
    plot.write(|| what_if::svg(&plot.title(title), &simulation))?;
    let report = simulation.report;
    for note in &report.notes {
        terminal::note(&format!("warning: {note}"));
    }
    if !json {
        terminal::print(&report.to_string());
        terminal::note_warnings(&report.warnings);
        for path in [&out, &plot.path].into_iter().flatten() {
            terminal::print(&format!("written: {}", path.display()));
        }
    }
    Ok(report)
}

/// A flight with the settings of the arguments.
fn flight_of(path: &Path, args: &Args) -> Result<Flight> {
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
    Ok(flight)
}

fn run_flight(path: &Path, args: &Args, json: bool) -> Result<Report> {
    let flight = flight_of(path, args)?;
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
    terminal::note_warnings(&report.warnings);
    if let Some(fault) = &simulation.quality.first_fault {
        terminal::print(&format!(
            "{} bad frames were bridged; the first: line {}, frame {}, {}: {}",
            report.bridged_frames, fault.line, fault.index, fault.element, fault.message
        ));
    }
}
