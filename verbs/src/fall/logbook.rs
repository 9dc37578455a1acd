//! A logbook: one line for each jump on many tracks.

use std::path::{Path, PathBuf};

use bodyflight_falls::verdict::Verdict;
use serde::Serialize;

use super::answer::Answer;
use super::{Conditions, Moment, Report, falls};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::{CsvFile, number};
use bodyflight_io::progress;
use bodyflight_tracks as track;

/// A jump in a line.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Line {
    /// The file.
    pub track: String,
    /// Time of the exit, or of the start of the fall, since 1970 (s, UTC), if the file has a date.
    pub unix_s: Option<f64>,
    /// Verdict on the fall.
    pub verdict: Verdict,
    /// Height of the exit above mean sea level (m).
    pub exit_height_m: Option<f64>,
    /// Height of the opening above mean sea level (m).
    pub opening_height_m: Option<f64>,
    /// Time from the exit to the opening (s).
    pub fall_s: f64,
    /// Mean speed downwards (m/s).
    pub mean_rate_mps: f64,
    /// Largest speed downwards (m/s).
    pub fastest_mps: f64,
    /// Speed downwards in the steady part, at the reference height of the standard atmosphere (m/s).
    pub normalised_rate_mps: f64,
    /// Area times drag coefficient in the steady part (m2).
    pub drag_area_m2: Option<f64>,
    /// Largest specific force of the opening, as far as the receiver resolves it (multiples of gravity).
    pub opening_g: Option<f64>,
    /// Glide ratio through the air in the second half of the fall.
    pub glide: Option<f64>,
    /// Distance over ground in the fall (m).
    pub fall_distance_m: f64,
    /// Time under canopy (s).
    pub canopy_s: Option<f64>,
}

/// Columns of the logbook as CSV.
pub const COLUMNS: [&str; 15] = [
    "track",
    "unix_s",
    "date",
    "verdict",
    "exit_height_m",
    "opening_height_m",
    "fall_s",
    "mean_rate_mps",
    "fastest_mps",
    "normalised_rate_mps",
    "drag_area_m2",
    "opening_g",
    "glide",
    "fall_distance_m",
    "canopy_s",
];

/// The jumps on many tracks.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Logbook {
    /// Number of tracks read.
    pub tracks: usize,
    /// The jumps, in order of the tracks and of time.
    pub jumps: Vec<Line>,
    /// Tracks that have no fall or could not be read, with reasons.
    pub refused: Vec<String>,
}

/// The answer of `bodyflight fall`: for one track, or for a folder of tracks.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(untagged)]
pub enum Answers {
    /// For one track.
    One(Box<Answer>),
    /// For several tracks.
    Several(Logbook),
}

impl Line {
    fn of(track: &Path, report: &Report) -> Self {
        let height = |moment: &Option<Moment>| moment.map(|moment| moment.height_m);
        Self {
            track: track.to_string_lossy().into_owned(),
            unix_s: report
                .exit
                .or(report.opening)
                .and_then(|moment| moment.unix_s),
            verdict: report.verdict,
            exit_height_m: height(&report.exit),
            opening_height_m: height(&report.opening),
            fall_s: report.fall_s,
            mean_rate_mps: report.mean_rate_mps,
            fastest_mps: report.fastest_mps,
            normalised_rate_mps: report.normalised_rate_mps,
            drag_area_m2: report.drag_area_m2,
            opening_g: report.opening_details.map(|opening| opening.largest_g),
            glide: report.glide,
            fall_distance_m: report.fall_distance_m,
            canopy_s: report.canopy_s,
        }
    }

    /// Day and time of the jump (UTC), such as `2024-06-01 10:00:40`.
    pub fn date(&self) -> Option<String> {
        track::date(self.unix_s?)
    }
}

/// Analyses tracks. Jumps that are not certain are left out.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn logbook(tracks: &[PathBuf], conditions: &Conditions) -> Result<Logbook> {
    let mut book = Logbook {
        tracks: tracks.len(),
        jumps: Vec::new(),
        refused: Vec::new(),
    };
    progress::stage("tracks");
    for (index, path) in tracks.iter().enumerate() {
        progress::reached(index, tracks.len())?;
        let found = track::read(path).and_then(|track| falls(&track, conditions, path));
        match found {
            Ok(found) => {
                let mut lines: Vec<Line> = (found.jumps.iter())
                    .filter(|(report, _)| report.verdict != Verdict::Uncertain)
                    .map(|(report, _)| Line::of(path, report))
                    .collect();
                if let (true, Some((report, _))) = (lines.is_empty(), found.jumps.first()) {
                    book.refused
                        .push(format!("{}: {}", path.display(), report.reason));
                }
                lines.sort_by(|a, b| {
                    a.unix_s
                        .partial_cmp(&b.unix_s)
                        .unwrap_or(core::cmp::Ordering::Equal)
                });
                book.jumps.extend(lines);
            }
            Err(problem) => book.refused.push(problem.to_string()),
        }
    }
    Ok(book)
}

/// Writes a logbook as CSV.
///
/// # Errors
/// Returns an error if the file cannot be written.
pub fn write(book: &Logbook, path: &Path) -> Result<()> {
    let mut file = CsvFile::create(path, &COLUMNS)?;
    for line in &book.jumps {
        let maybe = |value: Option<f64>| value.map(number).unwrap_or_default();
        file.write_fields([
            line.track.clone(),
            maybe(line.unix_s),
            line.date().unwrap_or_default(),
            line.verdict.name().to_owned(),
            maybe(line.exit_height_m),
            maybe(line.opening_height_m),
            number(line.fall_s),
            number(line.mean_rate_mps),
            number(line.fastest_mps),
            number(line.normalised_rate_mps),
            maybe(line.drag_area_m2),
            maybe(line.opening_g),
            maybe(line.glide),
            number(line.fall_distance_m),
            maybe(line.canopy_s),
        ])?;
    }
    file.finish()
}
