//! `bodyflight validate`: compares the model with real recordings. Nothing is fitted, except where a row says so.
//!
//! In free flight the model has no excuse: postures and an initial motion must reproduce the measured rotation. The
//! bundled flights are somersaults with twists, see [`bundled`]; [`windows`] predicts parts of them. Loggers' tracks
//! have no postures; [`falls`] checks that their drag, wind and fall rate are consistent.

pub mod bundled;
pub mod captures;
pub mod check;
pub mod falls;
pub mod figure;
pub mod inputs;
pub mod windows;

use std::path::{Path, PathBuf};

use serde::Serialize;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::recorded::Recorded;
use check::Check;
use falls::FallRow;
use windows::{Row, Whole, predicted, whole};

/// Lengths of the windows that are predicted (s).
pub const LENGTHS: [f64; 2] = [0.25, 0.5];

/// Largest median error of the exact equations at the end of a window of each length (rad): 5 and 12 degrees.
const LARGEST: [f64; 2] = [0.0873, 0.2094];

/// Smallest ratio of the error of the published equations to that of the exact ones.
const LEAST_RATIO: f64 = 5.0;

/// The result of a validation.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Names of the flights.
    pub flights: Vec<String>,
    /// Predicted windows.
    pub windows: Vec<Row>,
    /// Whole flights with fitted start.
    pub whole: Vec<Whole>,
    /// Falls recorded by loggers.
    pub falls: Vec<FallRow>,
    /// Tracks whose fall could not be judged, and why.
    pub not_judged: Vec<String>,
    /// Captures in a table of the user's, by source.
    pub captures: captures::Captures,
    /// All results as one table.
    pub checks: Vec<Check>,
}

impl Report {
    /// The failed checks, in a sentence; `None` if all hold.
    pub fn failure(&self) -> Option<String> {
        let failed = self.checks.iter().filter(|check| !check.holds);
        let sentences: Vec<String> = failed
            .map(|check| {
                format!(
                    "{}: {} is {}, expected {}",
                    check.data, check.what, check.found, check.expected
                )
            })
            .collect();
        (!sentences.is_empty()).then(|| sentences.join("; "))
    }
}

/// Reads a whole flight.
///
/// # Errors
/// Returns an error if a file is unusable or has no velocities, or if the recording cannot be trusted.
pub fn read(path: &Path) -> Result<Recorded> {
    let flight = Flight::read(path)?;
    let (frames, _) = flight.open(Options::default())?.trusted(path)?;
    let height = frames
        .first()
        .map_or(0.0, |frame| frame.pelvis.position.components.z);
    Recorded::new(&frames, flight.dynamics(height), flight.constant_inputs())
}

/// Predicts windows of named flights, each flight as a whole, and the falls on tracks.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn validate(flights: &[(String, Recorded)], tracks: &[PathBuf]) -> Result<Report> {
    let recorded: Vec<&Recorded> = flights.iter().map(|(_, recorded)| recorded).collect();
    let mut rows = Vec::new();
    for length in LENGTHS {
        for model in windows::MODELS {
            progress::stage(format!("{}, windows of {length} s", model.name));
            rows.extend(predicted(&recorded, length, model)?);
        }
    }
    let mut whole_flights = Vec::new();
    progress::stage("whole flights");
    for (index, model) in windows::MODELS.iter().enumerate() {
        progress::reached(index, windows::MODELS.len())?;
        whole_flights.push(whole(&recorded, *model));
    }
    let names: Vec<String> = flights.iter().map(|(name, _)| name.clone()).collect();
    let mut checks = if names.is_empty() {
        Vec::new()
    } else {
        window_checks(&names.join(", "), &rows)
    };
    let (falls, not_judged) = falls::judged(tracks)?;
    checks.extend(falls::checks(&falls));
    Ok(Report {
        flights: names,
        windows: rows,
        whole: whole_flights,
        falls,
        not_judged,
        captures: captures::Captures::default(),
        checks,
    })
}

/// Checks that windows of free flight must pass.
fn window_checks(data: &str, rows: &[Row]) -> Vec<Check> {
    let mut checks = Vec::new();
    for (length, largest) in LENGTHS.into_iter().zip(LARGEST) {
        let mut add = |what: &str, expected: String, found: String, holds: bool| {
            checks.push(Check {
                data: data.to_owned(),
                what: format!("{length} s, {what}"),
                expected,
                found,
                holds,
            });
        };
        let row = |key: &str| {
            let of_length = |row: &&Row| (row.length_s - length).abs() < 1e-9;
            rows.iter().filter(of_length).find(|row| row.model == key)
        };
        let (Some(exact), Some(published)) = (row("exact"), row("as-published")) else {
            let expected = "at least one".to_owned();
            add(
                "windows",
                expected,
                "none, as the flights are shorter".to_owned(),
                false,
            );
            continue;
        };
        let degrees = |angle: f64| format!("{:.1} degrees", angle.to_degrees());
        let (median, smoothed) = (exact.first_frame.median_rad, exact.smoothed.median_rad);
        add(
            "error of the exact equations",
            format!("at most {}", degrees(largest)),
            degrees(median),
            median <= largest,
        );
        add(
            "error of the exact equations, smoothed start",
            "no more than from the first frame".to_owned(),
            degrees(smoothed),
            smoothed <= median,
        );
        let ratio = published.first_frame.median_rad / median;
        add(
            "error of the published equations relative to the exact ones",
            format!("at least {LEAST_RATIO} times worse"),
            format!("{ratio:.1} times"),
            ratio >= LEAST_RATIO,
        );
    }
    checks
}
