//! `bodyflight discover`: reads flights for the search, and turns its results into files.

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

/// Reads a flight together with its model.
///
/// # Errors
/// Returns an error if a file is unusable or has no velocities.
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
    refuse_same_flights(fitted, held_out)?;
    let mut tracks = Vec::new();
    for (place, flight) in fitted.iter().chain(held_out).enumerate() {
        if flysight::is_flysight(&flight.recording) {
            return Err(Problem::bad_input(
                "expected an MVNX recording, found that of a point (CSV)",
            )
            .in_file(&flight.recording)
            .help("flights that are held out must be of the same kind as those fitted"));
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

/// Cuts a track down to its fall: a point model does not apply to exit and opening.
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

/// Reads the track of a point, from exit to opening.
///
/// # Errors
/// Returns an error if the file is not from a FlySight or has too few usable rows.
pub fn read_point_track(path: &Path) -> Result<point::Track> {
    let mut track = flysight::Track::read(path)?;
    keep_fall(&mut track);
    let first = track.fixes.first();
    // Puts both sensors on one clock.
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

/// Explains why a search gave no report.
pub fn problem(error: Error) -> Problem {
    match error {
        Error::Cancelled => Problem::interrupted(),
        Error::TooShort { .. } => Problem::bad_input(error.to_string()),
        Error::NoFreeFall { descent_mps, .. } => {
            Problem::bad_input(error.to_string()).help(format!(
                "a fall is a descent faster than {descent_mps} m/s; a track recorded under an open canopy or on the ground has none"
            ))
        }
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
