//! `bodyflight fall`.

mod print;

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_tracks::{self as track, folder};
use bodyflight_verbs::fall::answer::Answer;
use bodyflight_verbs::fall::{Conditions, DEFAULT_MASS, Stated, figure, logbook};

use super::outputs::{Outputs, Plot};
use super::terminal;
use bodyflight_verbs::fall::units::Units;

/// Analyse the jumps on a logger's track: exit, fall rate, drag area, wind, opening, canopy. For a folder, such as a
/// logger's card, the jumps of all its tracks in a logbook.
#[derive(clap::Args)]
#[command(
    after_help = "Tracks: FlySight 1 and 2 (SENSOR.CSV beside TRACK.CSV is used), GPX, KML, IGC, NMEA, FIT, UBX, TES, or CSV \
    with a header line; see docs/falls.md. Exit code 4: the fall is not explained; 5: it is not certain that there is \
    one.\n\n\
                  Examples:\n  bodyflight fall TRACK.CSV --mass 85 --plot fall.svg\n  bodyflight fall 24-07-14 --logbook \
                  jumps.csv --units imperial"
)]
pub(super) struct Args {
    /// A logger's track, or a folder of tracks; - is standard input.
    track: PathBuf,
    /// Write a line for each jump to a CSV file, in SI units.
    #[arg(long, value_name = "FILE")]
    logbook: Option<PathBuf>,
    /// Units of the text: m/s and metres, km/h and metres, or mph and feet.
    #[arg(long, value_enum, default_value_t = UnitsName::Si)]
    units: UnitsName,
    /// Mass of skydiver and equipment (kg); the drag area is proportional to it.
    #[arg(long, value_name = "KG", default_value_t = DEFAULT_MASS)]
    mass: f64,
    /// Air pressure on the ground (hPa), not reduced to sea level; by default from the logger's barometer or the
    /// standard atmosphere.
    #[arg(long, value_name = "HPA")]
    ground_pressure: Option<f64>,
    /// Temperature on the ground (degrees Celsius); by default that of the standard atmosphere.
    #[arg(long, value_name = "C")]
    ground_temperature: Option<f64>,
    /// Height in the standard atmosphere to which fall rates are normalised (m); a greater height gives faster rates.
    #[arg(long, value_name = "M", default_value_t = 2000.0)]
    reference_height: f64,
    /// Track of another jumper from the same aircraft load; the winds of both falls are compared.
    #[arg(long, value_name = "TRACK")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
}

/// Units by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum UnitsName {
    /// Metres per second, metres.
    Si,
    /// Kilometres per hour, metres.
    Kmh,
    /// Miles per hour, feet.
    Imperial,
}

impl UnitsName {
    pub(super) const fn units(self) -> Units {
        match self {
            Self::Si => Units::Si,
            Self::Kmh => Units::Kmh,
            Self::Imperial => Units::Imperial,
        }
    }
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let conditions = conditions(args)?;
    if args.track.is_dir() {
        return run_folder(args, &conditions, json);
    }
    let spinner = terminal::spinner("reading");
    let track = track::read(&args.track)?;
    args.outputs.check_with([&args.logbook], &args.plot)?;
    let (answer, jump) = Answer::of(track, &args.track, &conditions, args.beside.as_deref())?;
    spinner.finish_and_clear();
    let title = || args.track.display().to_string();
    args.plot
        .write(|| figure::svg(&args.plot.title(title), &jump, conditions.mass))?;
    if let Some(path) = &args.logbook {
        logbook::write(
            &logbook::logbook(std::slice::from_ref(&args.track), &conditions)?,
            path,
        )?;
    }
    if json {
        terminal::print_json(&answer)?;
    } else {
        print::answer(&answer, args.units.units());
    }
    match answer.failure(&args.track, args.beside.as_deref()) {
        None => Ok(()),
        Some(problem) => Err(problem),
    }
}

/// The logbook of a folder.
fn run_folder(args: &Args, conditions: &Conditions, json: bool) -> Result<()> {
    if args.plot.path.is_some() || args.beside.is_some() {
        return Err(Problem::bad_input("--plot and --beside need one track")
            .help("give the track itself, not a folder"));
    }
    let tracks = folder::tracks(&args.track)?;
    args.outputs.check_as(args.logbook.as_deref(), "csv")?;
    let book = logbook::logbook(&tracks, conditions)?;
    if let Some(path) = &args.logbook {
        logbook::write(&book, path)?;
    }
    if json {
        terminal::print_json(&book)?;
    } else {
        print::logbook(&book, args.units.units());
    }
    if book.jumps.is_empty() {
        return Err(Problem::bad_input(format!(
            "none of the {} tracks has a fall that is certain",
            book.tracks
        ))
        .in_file(&args.track)
        .help(book.refused.first().cloned().unwrap_or_default()));
    }
    Ok(())
}

fn conditions(args: &Args) -> Result<Conditions> {
    let names = [
        "--mass",
        "--ground-pressure",
        "--ground-temperature",
        "--reference-height",
    ];
    Stated {
        mass: args.mass,
        ground_pressure: args.ground_pressure,
        ground_temperature: args.ground_temperature,
        reference_height: args.reference_height,
    }
    .checked(names)
}
