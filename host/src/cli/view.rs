//! `bodyflight view`.

mod track;

use std::path::{Path, PathBuf};

use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::files::write_file;
use bodyflight_io::input;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::flight::{Flight, name_of};
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::preset_file::{AUTO, Tuning};
use bodyflight_verbs::fall::DEFAULT_MASS;
use bodyflight_verbs::view::estimated::estimated;
use bodyflight_verbs::view::page::{PageData, Provenance, html};
use bodyflight_verbs::view::run::{Run, fly};
use serde::Serialize;
use serde_json::Value;

use super::arguments::Names;
use super::estimate::{MethodName, presets};
use super::fall::UnitsName;
use super::outputs::Outputs;
use super::several::file_of;
use super::simulate::Reading;
use super::terminal::{self, FlightBar};

/// Write a page that replays flights with body, plots and forces: one HTML file to view or send. For loggers' tracks, a
/// page about their jumps.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  bodyflight view flight.toml --out flight.html --open\n  \
                  bodyflight view turn-1 turn-2 --estimate\n  \
                  bodyflight view flight.toml --model found/model.toml --discovery found/report.json\n\n\
                  bodyflight view TRACK.CSV --units kmh\n  bodyflight view CARD --out logbook.html\n\n\
                  Exit code 5: the page was written, but a recording contradicts itself, or an estimate cannot be trusted.\n\n\
                  With --model, a second run with the effects is shown beside the plain one. Of a logger's tracks, or a folder \
                  of them, the page has figures, map, height, speed and drag area."
)]
pub(super) struct Args {
    /// flight.toml files, or MVNX files on their own; several flights are overlaid. Or loggers' tracks, or folders of them.
    #[arg(required = true)]
    flights: Vec<PathBuf>,
    /// The page to write.
    #[arg(long, value_name = "HTML", default_value = "view.html")]
    out: PathBuf,
    /// Effects to add to the model in a second run of each flight: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// The report.json of bodyflight discover, to show beside the flights.
    #[arg(long, value_name = "JSON")]
    discovery: Option<PathBuf>,
    /// Estimate muscle input and damping, and show them with bands of two standard deviations.
    #[arg(long)]
    estimate: bool,
    /// A built-in preset or a preset.toml, as in `estimate`.
    #[arg(long, default_value = AUTO, requires = "estimate", value_parser = Names(presets), hide_possible_values = true)]
    preset: String,
    /// Filter forward in time as on the unit, or smooth the whole flight.
    #[arg(long, value_enum, requires = "estimate", default_value = "filter")]
    method: MethodName,
    /// Leave out the recording at its full rate: the page is smaller, and has no what-if and CSV at 30 rows per second.
    #[arg(long)]
    light: bool,
    /// Units of the page about tracks.
    #[arg(long, value_enum, default_value_t = UnitsName::Si)]
    units: UnitsName,
    /// Mass of skydiver and equipment (kg), for the drag areas of tracks.
    #[arg(long, value_name = "KG", default_value_t = DEFAULT_MASS)]
    mass: f64,
    /// Open the page in a browser.
    #[arg(long)]
    open: bool,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Written {
    page: PathBuf,
    bytes: usize,
    runs: usize,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let (html, runs, doubt) = if track::are_tracks(&args.flights) {
        if args.model.is_some() || args.discovery.is_some() || args.estimate {
            return Err(Problem::bad_input(
                "--model, --discovery and --estimate need flights with postures, and these are tracks",
            ));
        }
        args.outputs.check_as(Some(&args.out), "html")?;
        let (html, runs) = track::page(&args.flights, args.mass, args.units.units())?;
        (html, runs, None)
    } else {
        let page = page(args)?;
        let doubt = page.runs.iter().find_map(|run| {
            let estimate = run
                .estimated
                .as_ref()
                .and_then(|found| found.doubt.as_ref());
            Some((run.name.clone(), run.doubt.as_ref().or(estimate)?.clone()))
        });
        (html(&page)?, page.runs.len(), doubt)
    };
    write_file(&args.out, html.as_bytes())?;
    if args.open {
        open(&args.out);
    }
    if json {
        terminal::print_json(&Written {
            page: args.out.clone(),
            bytes: html.len(),
            runs,
        })?;
    } else {
        terminal::print(&format!(
            "written: {} ({:.1} MB, opens in a browser without a network)",
            args.out.display(),
            html.len() as f64 / 1e6
        ));
    }
    match doubt {
        None => Ok(()),
        Some((name, doubt)) => Err(Problem::doubt(doubt)
            .at(name)
            .help("the page was written, but do not trust what it shows")),
    }
}

/// Opens a page in a browser. If there is none, the caller has still printed the page's address.
pub(super) fn open(page: impl AsRef<std::ffi::OsStr>) {
    if let Err(error) = open::that_detached(page.as_ref()) {
        terminal::note(&format!("no browser was found: {error}"));
    }
}

fn page(args: &Args) -> Result<PageData> {
    let mut files: Vec<PathBuf> = Vec::new();
    let mut runs = Vec::new();
    let effects = args.model.as_deref().map(Effects::read).transpose()?;
    effects.iter().for_each(terminal::note_random);
    let options = args.reading.options();
    let flights = args
        .flights
        .iter()
        .map(|path| Ok((path, Flight::read(path)?)))
        .collect::<Result<Vec<_>>>()?;
    let discovery = args.discovery.as_deref().map(report).transpose()?;
    let request = args
        .estimate
        .then(|| {
            Ok(Request {
                tuning: Tuning::find(&args.preset)?,
                method: args.method.method(),
                filter: None,
            })
        })
        .transpose()?;
    args.outputs.check_as(Some(&args.out), "html")?;
    for (path, mut flight) in flights {
        files.push(file_of(path));
        if flight.recording != *path {
            files.push(flight.recording.clone());
        }
        let name = name_of(path);
        let mut run = flown(&name, &flight, options, !args.light)?;
        if let Some(request) = &request {
            let bar = FlightBar::new("estimating", &flight);
            let found = estimated(&flight, request, options, &mut |time| bar.at(time));
            bar.end();
            run.estimated = Some(found?);
        }
        runs.push(run);
        if let Some(effects) = &effects {
            flight.effects = effects.clone();
            let name = format!("{name}, extended model");
            runs.push(flown(&name, &flight, options, !args.light)?);
        }
    }
    files.extend(args.model.clone());
    files.extend(args.discovery.clone());
    let files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    let provenance = Provenance::of(command(), &files)?;
    let title = args
        .flights
        .first()
        .map_or_else(String::new, |path| name_of(path));
    let mut page = PageData::replay(title, provenance, runs);
    page.discovery = discovery;
    Ok(page)
}

fn flown(name: &str, flight: &Flight, options: Options, is_full: bool) -> Result<Run> {
    let bar = FlightBar::new("flying", flight);
    let run = fly(name, flight, options, is_full, &mut |time| bar.at(time));
    bar.end();
    run
}

/// The command line, with folders removed from file names.
pub(super) fn command() -> String {
    let bare = |word: &std::ffi::OsString| {
        let name = Path::new(word).file_name().unwrap_or(word);
        name.to_string_lossy().into_owned()
    };
    terminal::arguments()
        .iter()
        .map(bare)
        .collect::<Vec<_>>()
        .join(" ")
}

fn report(path: &Path) -> Result<Value> {
    let text = input::settings(path, FileKind::Json)?;
    let report: Value = serde_json::from_str(&text).map_err(|error| {
        Problem::bad_input("expected JSON")
            .in_file(path)
            .caused_by(error)
    })?;
    if report.get("verdict").is_none() {
        return Err(Problem::bad_input("expected a field \"verdict\"")
            .in_file(path)
            .help("bodyflight discover --out FOLDER writes a report.json"));
    }
    Ok(report)
}
