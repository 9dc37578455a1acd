//! `bodyflight validate`: the model against real recordings, nothing fitted but what a row says.
//!
//! In the air without a canopy the model has no excuse: postures and a first motion must give the turning that was
//! measured. The bundled flights are somersaults with twists, see [`bundled`]; [`windows`] predicts parts of them.

pub mod bundled;
pub mod figure;
pub mod windows;

use std::path::Path;

use serde::Serialize;

use crate::diagnostic::Result;
use crate::formats::flight::Flight;
use crate::formats::recording::Options;
use crate::replay::recorded::Recorded;
use windows::{Row, Whole, predicted, whole};

/// Lengths of the windows that are predicted (s).
pub const LENGTHS: [f64; 2] = [0.25, 0.5];

/// Largest median error of the exact equations at the end of a window of each length (rad): 5 and 12 degrees.
const LARGEST: [f64; 2] = [0.0873, 0.2094];

/// Least ratio of the error of the published equations to that of the exact ones.
const LEAST_RATIO: f64 = 5.0;

/// What was found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Windows, predicted.
    pub windows: Vec<Row>,
    /// Whole flights, their start fitted.
    pub whole: Vec<Whole>,
    /// What is not as it must be, in sentences; empty where all is well.
    pub failures: Vec<String>,
}

/// Reads a flight as a whole.
///
/// # Errors
/// Returns an error if a file is not usable or has no velocities.
pub fn read(path: &Path) -> Result<Recorded> {
    let flight = Flight::read(path)?;
    let recording = flight.open(Options::default())?;
    let frames = recording.collect::<Result<Vec<_>>>()?;
    let height = frames
        .first()
        .map_or(0.0, |frame| frame.pelvis.position.components.z);
    Recorded::new(&frames, flight.dynamics(height), flight.constant_inputs())
}

/// Predicts windows of flights, named ones, and each as a whole.
pub fn validate(flights: &[(String, Recorded)], mut progress: impl FnMut(&str)) -> Report {
    let recorded: Vec<&Recorded> = flights.iter().map(|(_, recorded)| recorded).collect();
    let mut rows = Vec::new();
    for length in LENGTHS {
        for model in windows::MODELS {
            progress(model.name);
            rows.extend(predicted(&recorded, length, model));
        }
    }
    let whole_flights = windows::MODELS
        .iter()
        .map(|model| whole(&recorded, *model))
        .collect();
    Report {
        flights: flights.iter().map(|(name, _)| name.clone()).collect(),
        failures: failures(&rows),
        windows: rows,
        whole: whole_flights,
    }
}

/// Where the figures are not what the bundled flights allow.
fn failures(rows: &[Row]) -> Vec<String> {
    let mut failures = Vec::new();
    for (length, largest) in LENGTHS.into_iter().zip(LARGEST) {
        let row = |key: &str| {
            let of_length = |row: &&Row| (row.length_s - length).abs() < 1e-9;
            rows.iter().filter(of_length).find(|row| row.model == key)
        };
        let (Some(exact), Some(published)) = (row("exact"), row("as-published")) else {
            failures.push(format!("no window of {length} s: the flights are shorter"));
            continue;
        };
        let median = exact.first_frame.median_rad;
        if median > largest {
            failures.push(format!(
                "exact equations are {:.1} degrees off after {length} s, expected at most {:.1}",
                median.to_degrees(),
                largest.to_degrees()
            ));
        }
        if exact.smoothed.median_rad > median {
            failures.push(format!(
                "a smoothed start makes windows of {length} s worse: {:.1} instead of {:.1} degrees",
                exact.smoothed.median_rad.to_degrees(),
                median.to_degrees()
            ));
        }
        let ratio = published.first_frame.median_rad / median;
        if ratio < LEAST_RATIO {
            failures.push(format!(
                "published equations are {ratio:.1} times worse after {length} s, expected at least {LEAST_RATIO}"
            ));
        }
    }
    failures
}
