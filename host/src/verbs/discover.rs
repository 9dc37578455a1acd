//! `bodyflight discover`: flights read for the search, and what it found as files.

pub mod figure;

use std::path::Path;

use bodyflight_discovery::description::told::Described;
use bodyflight_discovery::error::Error;
use bodyflight_discovery::point::track as point;
use bodyflight_discovery::progress::Progress;
use bodyflight_discovery::report::{ByName, Report};
use bodyflight_discovery::search::{self, Settings};
use bodyflight_discovery::track::{Frame, Track};
use bodyflight_falls::Sample;
use bodyflight_falls::phases::{divided, times};

use crate::diagnostic::{Problem, Result};
use crate::formats::flight::Flight;
use crate::formats::flysight;
use crate::formats::input;
use crate::formats::model_file;
use crate::formats::recording::{FlightFrame, Options};

/// Reads a flight with the model that is meant to fly it.
///
/// # Errors
/// Returns an error if a file is not usable or has no velocities.
pub fn read_track(flight: &Flight, options: Options) -> Result<Track> {
    let recording = flight.open(options)?;
    let frames = recording.collect::<Result<Vec<_>>>()?;
    let first = frames.first().ok_or_else(|| {
        Problem::bad_input("expected frames of type \"normal\"").in_file(&flight.recording)
    })?;
    let dynamics = flight.dynamics(first.pelvis.position.components.z);
    let frame = |frame: &FlightFrame| {
        Ok(Frame {
            time: frame.time,
            posture: frame.posture,
            motion: frame.motion()?,
        })
    };
    let frames = frames.iter().map(frame).collect::<Result<Vec<_>>>()?;
    Ok(Track::new(&frames, dynamics, |time| flight.inputs_at(time)))
}

/// Refuses a flight that is held out from itself: it would confirm whatever was fitted to it.
///
/// # Errors
/// Returns an error if two recordings are the same file, or files of the same content.
pub fn refuse_same(recording: &Path, held_out: &Path) -> Result<()> {
    let length = |path: &Path| std::fs::metadata(path).map(|about| about.len()).ok();
    if length(recording) != length(held_out) || !input::are_alike(recording, held_out)? {
        return Ok(());
    }
    Err(Problem::bad_input(format!(
        "this flight is held out, but it is the one that effects are fitted to ({})",
        recording.display()
    ))
    .in_file(held_out)
    .help("hold out another flight of the same person"))
}

/// As [`refuse_same`], each held-out flight from each fitted one.
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

/// What is searched for in flights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Most effects that are named.
    pub max_effects: usize,
    /// Seed of what is drawn.
    pub seed: u64,
}

/// Names what the model misses in flights, checked on those that are held out; tolerances are the first flight's.
/// `options` are how each flight is read, the fitted ones first.
///
/// # Errors
/// Returns an error if a flight is held out from itself, a file is not usable or no recording of a whole body, or the search
/// finds no fall in it.
pub fn discover_flights(
    fitted: &[Flight],
    held_out: &[Flight],
    options: impl Fn(usize) -> Options,
    request: Request,
    progress: &dyn Progress,
) -> Result<Report> {
    refuse_same_flights(fitted, held_out)?;
    let mut tracks = Vec::new();
    for (place, flight) in fitted.iter().chain(held_out).enumerate() {
        if flysight::is_flysight(&flight.recording) {
            return Err(Problem::bad_input(
                "expected an MVNX recording, found that of a point (CSV)",
            )
            .in_file(&flight.recording)
            .help("flights that are held out must be of the kind that effects are fitted to"));
        }
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
    search::discover(fitted, held_out, &settings, progress).map_err(problem)
}

/// Cuts a track to its fall: exit and opening are no fall of one posture.
fn keep_fall(track: &mut flysight::Track) {
    let samples: Vec<Sample> = track
        .fixes
        .iter()
        .map(|fix| Sample {
            time: fix.time,
            position: fix.position.components,
            velocity: fix.velocity.components,
        })
        .collect();
    if let Some(times) = times(&samples, &divided(&samples)) {
        let [from, until] = times.fall;
        track.fixes.retain(|fix| (from..=until).contains(&fix.time));
    }
}

/// Reads the recording of a point, from the exit to the opening.
///
/// # Errors
/// Returns an error if the file is not of a FlySight or has too few rows that are usable.
pub fn read_point_track(path: &Path) -> Result<point::Track> {
    let mut track = flysight::Track::read(path)?;
    keep_fall(&mut track);
    let first = track.fixes.first();
    // Both sensors on one clock.
    let offset = first.map_or(0.0, |fix| fix.time - fix.time_of_week());
    let fix = |fix: &flysight::Fix| point::Fix {
        time: fix.time,
        position: fix.position,
        velocity: fix.velocity,
    };
    let force =
        |sample: &flysight::InertialSample| (sample.time_of_week + offset, sample.specific_force);
    Ok(point::Track {
        fixes: track.fixes.iter().map(fix).collect(),
        specific_force: track.inertial.iter().map(force).collect(),
        rows_skipped: track.skipped.count,
    })
}

/// Why a search gave no report, for people.
pub fn problem(error: Error) -> Problem {
    match error {
        Error::Cancelled => Problem::interrupted(),
        Error::TooShort { .. } => Problem::bad_input(error.to_string()),
        Error::NoFreeFall { descent_mps, .. } => {
            Problem::bad_input(error.to_string()).help(format!(
                "a fall is where the descent is faster than {descent_mps} m/s; a jump under an open canopy or on the ground has none"
            ))
        }
    }
}

/// The effects found as a `model.toml`, and the loads described.
pub fn model_toml(model: &[ByName], described: Option<&Described>) -> String {
    let loads = described.map_or(&[][..], |described| &described.loads);
    let loads: Vec<_> = loads.iter().map(|described| described.load).collect();
    model_file::model_toml("# Effects found by bodyflight discover.\n", model, &loads)
}

/// Adjustments within the tolerances as a `model.toml`.
pub fn calibration_toml(corrections: &[ByName]) -> String {
    model_file::model_toml(
        "# Subject and coefficients as bodyflight discover found them, within their tolerances: simulate --model flies with\n\
         # them.\n",
        corrections,
        &[],
    )
}
