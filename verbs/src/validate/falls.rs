//! Falls recorded by loggers: checks that a body's drag explains them, that error bars of predictions are realistic,
//! and that winds found in two ways agree.

use std::path::PathBuf;

use bodyflight_falls::prediction::Trials;
use bodyflight_falls::verdict::Verdict;
use serde::Serialize;

use super::check::Check;
use crate::fall::{Conditions, Report, fall};
use bodyflight_io::diagnostic::Result;
use bodyflight_io::progress;
use bodyflight_tracks as track;

/// Largest error of a prediction or a wind (standard deviations).
const MOST_APART: f64 = 3.0;

/// Number of trial predictions from which their share within one deviation is checked, and the smallest share allowed;
/// for a normal distribution it is 0.68.
const ENOUGH_TRIALS: usize = 30;
const LEAST_WITHIN: f64 = 0.55;

/// The fall of a track.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct FallRow {
    /// The file.
    pub track: String,
    /// Analysis of the fall.
    #[serde(flatten)]
    pub report: Report,
}

/// The falls on tracks, and the tracks that were not judged, with reasons.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn judged(tracks: &[PathBuf]) -> Result<(Vec<FallRow>, Vec<String>)> {
    let (mut rows, mut not_judged) = (Vec::new(), Vec::new());
    progress::stage("tracks");
    for (index, path) in tracks.iter().enumerate() {
        progress::reached(index, tracks.len())?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let found = track::read(path).and_then(|track| fall(&track, &Conditions::default(), path));
        match found {
            Ok((report, _)) if matches!(report.verdict, Verdict::Thin | Verdict::Uncertain) => {
                not_judged.push(format!("{name}: {}", report.reason));
            }
            Ok((report, _)) => rows.push(FallRow {
                track: name.into_owned(),
                report,
            }),
            Err(problem) => not_judged.push(problem.to_string()),
        }
    }
    Ok((rows, not_judged))
}

/// Checks that falls must pass.
pub fn checks(rows: &[FallRow]) -> Vec<Check> {
    let mut checks = Vec::new();
    let mut all = Trials::default();
    for FallRow { track, report } in rows {
        let mut add = |what: &str, expected: &str, found: String, holds: bool| {
            checks.push(Check {
                data: track.clone(),
                what: what.to_owned(),
                expected: expected.to_owned(),
                found,
                holds,
            });
        };
        let explained = report.verdict == Verdict::Explained;
        add(
            "mass per drag area",
            "one that explains the fall",
            match report.ballistic_kgpm2 {
                Some(ballistic) if explained => format!("{ballistic:.0} kg/m2"),
                _ => report.reason.clone(),
            },
            explained,
        );
        if let Some(prediction) = &report.prediction {
            let off = prediction.measured_mps - prediction.predicted_mps;
            let deviations = off.abs() / prediction.deviation_mps;
            add(
                "last third, predicted from the first two",
                "within 3 deviations",
                format!(
                    "{:.1} +- {:.1}, {:.1} m/s",
                    prediction.predicted_mps, prediction.deviation_mps, prediction.measured_mps
                ),
                deviations <= MOST_APART,
            );
            let trials = prediction.trials;
            all.made += trials.made;
            all.held += trials.held;
            all.within_one += trials.within_one;
            all.within_two += trials.within_two;
        }
        if let Some(apart) = report.winds_apart {
            add(
                "winds of fall and canopy",
                "within 3 deviations",
                format!("{apart:.1} deviations"),
                apart <= MOST_APART,
            );
        }
    }
    if all.made >= ENOUGH_TRIALS {
        let share = |count: usize| 100.0 * count as f64 / all.made as f64;
        checks.push(Check {
            data: "all falls".to_owned(),
            what: format!("{} trial predictions", all.made),
            expected: "at least 55 % within one deviation (ideally 68 %)".to_owned(),
            found: format!(
                "{:.0} %, {:.0} % within two; {:.0} % within 5 %",
                share(all.within_one),
                share(all.within_two),
                share(all.held)
            ),
            holds: share(all.within_one) >= 100.0 * LEAST_WITHIN,
        });
    }
    checks
}
