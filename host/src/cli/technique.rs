//! `bodyflight technique`.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::CsvFile;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::flight::{Flight, name_of};
use bodyflight_verbs::output::figure::{Format, write_figure};
use bodyflight_verbs::technique::against::Expert;
use bodyflight_verbs::technique::figure::{amplitudes_svg, bode_svg, picture_svg};
use bodyflight_verbs::technique::report::Report;
use bodyflight_verbs::technique::{Settings, Technique, expert, joint_error, technique};

use super::arguments::window;
use super::outputs::{Outputs, Plot};
use super::several::{self, each, output_of};
use super::{simulate, terminal};

/// Find the movement patterns of a maneuver, and how this body's fall and turn answer to each.
#[derive(clap::Args)]
#[command(
    after_help = "Patterns are principal components of the joint angles, named as in simulate --joint. The response is that of the\n\
                  model linearised about the trimmed neutral pose of the flight's subject (docs/technique.md).\n\n\
                  Examples:\n  bodyflight technique flight.toml --picture patterns.svg --bode bode.svg\n  \
                  bodyflight technique turn-1 --against turn-2 --against turn-3\n\n\
                  Exit code 5: no pattern is above joint errors, the response is not that of the maneuver, or the recording cannot be trusted."
)]
pub(super) struct Args {
    /// flight.toml files, their folders, or MVNX files on their own; each is analysed separately.
    #[arg(required = true, value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// A flight of an expert to compare the turn pattern with; may be repeated.
    #[arg(long, value_name = "EXPERT")]
    against: Vec<PathBuf>,
    /// Analyse from this time on (s since frame 0).
    #[arg(long, value_name = "S")]
    from: Option<f64>,
    /// Analyse up to this time (s since frame 0).
    #[arg(long, value_name = "S")]
    to: Option<f64>,
    /// Analyse only turns faster than 0.5 rad/s, with a second around them; of experts too.
    #[arg(long)]
    turns: bool,
    /// Standard deviation of joint errors per axis; by default the tolerance of the flight, 2 degrees unless it says so.
    #[arg(long, value_name = "DEG")]
    joint_error_deg: Option<f64>,
    /// Write the amplitudes of the patterns over time as CSV (rad).
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    /// Write the frequency responses as CSV.
    #[arg(long, value_name = "CSV")]
    csv: Option<PathBuf>,
    /// Draw the Bode plot of the turn rate, as SVG, PDF or PNG.
    #[arg(long, value_name = "FILE")]
    bode: Option<PathBuf>,
    /// Draw the patterns on the body, as SVG, PDF or PNG.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: simulate::Reading,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    window(args.from, args.to)?;
    let settings = Settings {
        from: args.from,
        to: args.to,
        turns: args.turns,
        joint_error: joint_error("--joint-error-deg", args.joint_error_deg)?,
    };
    let options = args.reading.options();
    let others = Settings {
        from: None,
        to: None,
        ..settings
    };
    let experts = args
        .against
        .iter()
        .map(|path| read_expert(path, &others, options))
        .collect::<Result<Vec<_>>>()?;
    each(&args.flights, json, |path| {
        let report = run_flight(path, args, &settings, &experts, json)?;
        let doubt = (!report.doubts.is_empty()).then(|| report.doubts.join("; "));
        Ok((report, several::verdict(doubt, path)))
    })
}

fn read_expert(path: &Path, settings: &Settings, options: Options) -> Result<Expert> {
    let flight = Flight::read(path)?;
    expert(name_of(path), &flight, settings, options)
}

fn run_flight(
    path: &Path,
    args: &Args,
    settings: &Settings,
    experts: &[Expert],
    json: bool,
) -> Result<Report> {
    let flight = Flight::read(path)?;
    let file = |wanted: &Option<PathBuf>| output_of(wanted.as_ref(), path, &args.flights);
    let (out, csv) = (file(&args.out)?, file(&args.csv)?);
    let (bode, picture) = (file(&args.bode)?, file(&args.picture)?);
    let plot = args.plot.of(path, &args.flights)?;
    for figure in [&bode, &picture].into_iter().flatten() {
        Format::of(figure)?;
    }
    args.outputs.check([&bode, &picture])?;
    args.outputs.check_with([&out, &csv], &plot)?;
    let found = technique(&flight, settings, experts, args.reading.options())?;
    terminal::note_assumed_subject(&flight);
    let title = |what: &str| format!("{}: {what}", name_of(path));
    if let Some(out) = &out {
        write_amplitudes(out, &found)?;
    }
    if let Some(csv) = &csv {
        write_responses(csv, &found.report)?;
    }
    if let Some(file) = &bode {
        write_figure(file, &bode_svg(&title("turn rate by pattern"), &found)?)?;
    }
    if let Some(file) = &picture {
        let body = flight.subject.body();
        write_figure(
            file,
            &picture_svg(&title("movement patterns"), &body, &found),
        )?;
    }
    let name = || title("amplitudes of the patterns");
    plot.write(|| amplitudes_svg(&plot.title(name), &found))?;
    if !json {
        terminal::print(found.report.to_string().trim_end());
        terminal::note_warnings(&found.report.warnings);
        for written in [&out, &csv, &bode, &picture, &plot.path]
            .into_iter()
            .flatten()
        {
            terminal::print(&format!("written: {}", written.display()));
        }
    }
    Ok(found.report)
}

fn write_amplitudes(path: &Path, found: &Technique) -> Result<()> {
    let used = &found.components[..found.report.patterns.len()];
    let names = (1..=used.len()).map(|number| format!("pattern_{number}_rad"));
    let columns: Vec<String> = std::iter::once("time_s".to_owned()).chain(names).collect();
    let mut file = CsvFile::create(path, &columns)?;
    for (row, time) in found.time.iter().enumerate() {
        let amplitudes = used.iter().map(|component| component.amplitude[row]);
        file.write(std::iter::once(*time).chain(amplitudes))?;
    }
    file.finish()
}

fn write_responses(path: &Path, report: &Report) -> Result<()> {
    let columns = [
        "pattern",
        "output",
        "frequency_hz",
        "gain",
        "gain_deviation",
        "phase_rad",
    ];
    let mut file = CsvFile::create(path, &columns)?;
    for (number, pattern) in report.patterns.iter().enumerate() {
        let responses = pattern.answer.iter().flat_map(|answer| &answer.responses);
        for response in responses {
            for point in &response.bode {
                let numbers = [
                    point.frequency_hz,
                    point.gain,
                    point.gain_deviation,
                    point.phase_rad,
                ];
                let fields = [(number + 1).to_string(), response.output.to_owned()];
                let numbers = numbers.map(bodyflight_io::files::number);
                file.write_fields(fields.into_iter().chain(numbers))?;
            }
        }
    }
    file.finish()
}
