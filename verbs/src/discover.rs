//! `bodyflight discover`: reads flights for the search, and turns its results into files.

pub mod figure;

use std::path::Path;

use bodyflight_discovery::error::Error;
use bodyflight_discovery::input::flight::RecordedFlight;
use bodyflight_discovery::named_effect::ByName;
use bodyflight_discovery::output::description::Described;
use bodyflight_discovery::output::report::Report;
use bodyflight_discovery::progress::Progress;
use bodyflight_discovery::{Settings, discover};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use bodyflight_mvnx::recording::{FlightFrame, Options};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::model_file;
use bodyflight_tracks::folder::is_track;

/// Reads a flight together with its model.
///
/// # Errors
/// Returns an error if a file is unusable or has no velocities, or if the recording contradicts itself: an effect would
/// be named for a fault of the recording.
pub fn read_track(flight: &Flight, options: Options) -> Result<RecordedFlight> {
    let frames = flight.open(options)?.trusted(&flight.recording)?;
    let first = frames.first().ok_or_else(|| {
        Problem::bad_input("expected frames of type \"normal\"").in_file(&flight.recording)
    })?;
    let dynamics = flight.dynamics(first.pelvis.position.components.z);
    let samples = frames
        .iter()
        .map(FlightFrame::sample)
        .collect::<Result<Vec<_>>>()?;
    Ok(RecordedFlight::new(&samples, dynamics, |time| {
        flight.inputs_at(time)
    }))
}

/// Refuses a logger's track: a point has no posture for which an effect could be missing.
///
/// # Errors
/// Returns an error that names the verb for tracks.
pub fn refuse_track(recording: &Path) -> Result<()> {
    // A table of something else than a track is named by the reader of recordings.
    let is_other = input::kind(recording).is_some_and(|kind| kind != FileKind::Track);
    if !is_track(recording) || is_other {
        return Ok(());
    }
    Err(Problem::bad_input(
        "this is the track of a point, which has no postures: what differs from the model cannot be told from them",
    )
    .in_file(recording)
    .help(format!(
        "bodyflight fall {} finds drag area and its changes, wind over height, and channels that are wrong",
        recording.display()
    )))
}

/// Refuses a held-out flight that is also fitted: it would confirm anything.
///
/// # Errors
/// Returns an error if two recordings are the same file, or files of the same content.
pub fn refuse_same(recording: &Path, held_out: &Path) -> Result<()> {
    let length = |path: &Path| std::fs::metadata(path).map(|about| about.len()).ok();
    if length(recording) != length(held_out) || !input::are_alike(recording, held_out)? {
        return Ok(());
    }
    Err(Problem::bad_input(format!(
        "this flight is held out, but effects are also fitted to it ({})",
        recording.display()
    ))
    .in_file(held_out)
    .help("hold out another flight of the same person"))
}

/// Same as [`refuse_same`], for each pair of a held-out and a fitted flight.
///
/// # Errors
/// Same as [`refuse_same`].
pub fn refuse_same_flights(fitted: &[Flight], held_out: &[Flight]) -> Result<()> {
    for held_out in held_out {
        for flight in fitted {
            refuse_same(&flight.recording, &held_out.recording)?;
        }
    }
    Ok(())
}

/// What to search for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Largest number of effects to name.
    pub max_effects: usize,
    /// Seed of the random flights.
    pub seed: u64,
}

/// Names what the model lacks in the fitted flights, checked on those held out. Tolerances are those of the first
/// flight. `options` says how to read each flight, the fitted ones first.
///
/// # Errors
/// Returns an error if a flight is both fitted and held out, a file is unusable or not the recording of a whole body,
/// or the search finds no fall in it.
pub fn discover_flights(
    fitted: &[Flight],
    held_out: &[Flight],
    options: impl Fn(usize) -> Options,
    request: Request,
    progress: &dyn Progress,
) -> Result<Report> {
    for flight in fitted.iter().chain(held_out) {
        refuse_track(&flight.recording)?;
    }
    refuse_same_flights(fitted, held_out)?;
    let mut tracks = Vec::new();
    for (place, flight) in fitted.iter().chain(held_out).enumerate() {
        tracks.push(read_track(flight, options(place))?);
    }
    let settings = Settings {
        max_effects: request.max_effects,
        seed: request.seed,
        tolerances: fitted
            .first()
            .map(|flight| flight.tolerances)
            .unwrap_or_default(),
    };
    let (fitted, held_out) = tracks.split_at(fitted.len());
    discover(fitted, held_out, &settings, progress).map_err(problem)
}

/// Explains why a search gave no report.
pub fn problem(error: Error) -> Problem {
    match error {
        Error::Cancelled => Problem::interrupted(),
        Error::TooShort { .. } => Problem::bad_input(error.to_string()),
    }
}

/// The effects found and the loads described, as a `model.toml`.
pub fn model_toml(model: &[ByName], described: Option<&Described>) -> String {
    let loads = described.map_or(&[][..], |described| &described.loads);
    let loads: Vec<_> = loads.iter().map(|described| described.load).collect();
    model_file::model_toml("# Effects found by bodyflight discover.\n", model, &loads)
}

/// Adjustments within the tolerances as a `model.toml`.
pub fn calibration_toml(corrections: &[ByName]) -> String {
    model_file::model_toml(
        "# Subject and coefficients as found by bodyflight discover within their tolerances; apply them with\n\
         # simulate --model.\n",
        corrections,
        &[],
    )
}
