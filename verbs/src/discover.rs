//! `bodyflight discover`: reads flights for the search, and turns its results into files.

pub mod figure;
mod in_words;
mod places;
mod reading;

use std::collections::HashMap;
use std::path::Path;

use bodyflight_core::flight_sample::FlightSample;
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
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::model_file;
use bodyflight_tracks::folder::is_track;
use reading::Reading;

/// Reads a flight together with its model; of a recording of jumps, the first.
///
/// # Errors
/// Returns an error if a file is unusable or has no velocities, or if the recording contradicts itself or is no fall.
pub fn read_track(flight: &Flight, options: Options) -> Result<RecordedFlight> {
    let tracks = Reading::of(flight, options)?.tracks;
    tracks.into_iter().next().ok_or_else(|| {
        Problem::bad_input("found no fall in this recording").in_file(&flight.recording)
    })
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

/// The motion of a frame, bit by bit. With the noise of sensors, no two frames are equal.
fn bits(sample: &FlightSample) -> [u64; 10] {
    let motion = &sample.motion;
    let [i, j, k, w] = motion.inertial_from_body.quaternion().coords.into();
    let [u, v, z] = motion.velocity.components.into();
    let [p, q, r] = motion.angular_velocity.components.into();
    [i, j, k, w, u, v, z, p, q, r].map(f64::to_bits)
}

/// Refuses a flight that is given twice, whole or in part: its evidence would count twice, and held out, it would
/// confirm anything. `fitted` is the number of flights that are not held out.
///
/// # Errors
/// Returns an error if two flights have frames in common, in whatever files. The first frame does not count: flights
/// without noise may start alike.
fn refuse_repeated(readings: &[(&Flight, Reading)], fitted: usize) -> Result<()> {
    if readings.len() < 2 {
        return Ok(());
    }
    let mut seen = HashMap::new();
    for (place, (flight, reading)) in readings.iter().enumerate() {
        let tracks = reading.tracks.iter();
        let frames = tracks.flat_map(|track| track.samples.iter().skip(1).map(bits));
        for frame in frames {
            let first = *seen.entry(frame).or_insert(place);
            if first == place {
                continue;
            }
            let other = readings[first].0.recording.display();
            let is_confirming = first < fitted && place >= fitted;
            let says = if is_confirming {
                format!("this flight is held out, but effects are also fitted to it ({other})")
            } else {
                format!(
                    "frames of this flight are also in {other}, so their evidence would count twice"
                )
            };
            return Err(Problem::bad_input(says).in_file(&flight.recording).help(
                if is_confirming {
                    "hold out another flight of the same person"
                } else {
                    "give each flight once"
                },
            ));
        }
    }
    Ok(())
}

/// What to search for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Request {
    /// Largest number of effects to name.
    pub max_effects: usize,
}

/// Names what the model lacks in the fitted flights, checked on those held out. Tolerances are those of the first
/// flight. `options` says how to read each flight, the fitted ones first.
///
/// # Errors
/// Returns an error if a flight is given twice, a file is unusable or not the recording of a whole body,
/// or the search finds no fall in it.
pub fn discover_flights(
    fitted: &[Flight],
    held_out: &[Flight],
    options: impl Fn(usize) -> Options,
    request: Request,
    progress: &dyn Progress,
) -> Result<Report> {
    let flights: Vec<&Flight> = fitted.iter().chain(held_out).collect();
    for flight in &flights {
        refuse_track(&flight.recording)?;
    }
    let mut readings = Vec::new();
    for (place, flight) in flights.iter().enumerate() {
        readings.push((*flight, Reading::of(flight, options(place))?));
    }
    refuse_repeated(&readings, fitted.len())?;
    let of_jumps = reading::judged(&readings)?;
    let settings = Settings {
        max_effects: request.max_effects,
        tolerances: fitted
            .first()
            .map(|flight| flight.tolerances)
            .unwrap_or_default(),
    };
    let remarks = readings.iter().flat_map(|(flight, reading)| {
        let said = reading.remarks.iter();
        said.map(|warning| format!("{}: {warning}", flight.recording.display()))
    });
    let mut warnings: Vec<String> = remarks.chain(of_jumps).collect();
    let tracks = |readings: &[(&Flight, Reading)]| -> Vec<RecordedFlight> {
        let each = readings.iter();
        each.flat_map(|(_, reading)| reading.tracks.clone())
            .collect()
    };
    let (here, there) = readings.split_at(fitted.len());
    let (mut fitted, mut held_out) = (tracks(here), tracks(there));
    if there.is_empty() && here.iter().all(|(_, reading)| reading.whole.is_none()) {
        // The later jumps of a recording confirm the earlier ones.
        held_out = fitted.split_off(fitted.len().div_ceil(2));
    }
    let mut report = discover(&fitted, &held_out, &settings, progress)
        .map_err(|error| with_remarks(error, &warnings))?;
    if let Some((before, said)) = places::contradicted(&report, &fitted) {
        // What was named before it stays.
        let settings = Settings {
            max_effects: before,
            ..settings
        };
        warnings.push(said);
        report = discover(&fitted, &held_out, &settings, progress).map_err(problem)?;
    }
    report.warnings = warnings;
    if let (Some((flight, reading)), false) = (here.first(), report.effects.is_empty())
        && let Some(frames) = &reading.whole
    {
        report.changes = in_words::changes(&report, flight, frames)?;
    }
    Ok(report)
}

/// Explains why a search gave no report. What the recordings say of themselves is told all the same.
fn with_remarks(error: Error, remarks: &[String]) -> Problem {
    let problem = problem(error);
    if remarks.is_empty() {
        return problem;
    }
    problem.help(format!(
        "without a search, the recordings say this much: {}",
        remarks.join("; ")
    ))
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
