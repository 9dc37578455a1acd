//! What is known of one track, and the verdict on it.

use std::path::Path;

use bodyflight_falls::channels::Finding;
use bodyflight_falls::fall::Jump;
use bodyflight_falls::verdict::Verdict;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_tracks::Track;
use serde::Serialize;

use super::{Conditions, Report, beside, falls};

/// What is known of one track.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Answer {
    /// The jump that the track is about: the longest certain fall.
    #[serde(flatten)]
    pub report: Report,
    /// The other jumps of the track, in order of time.
    pub other_jumps: Vec<Report>,
    /// Channels that contradict each other, and what was done about it.
    pub channels: Vec<Finding>,
    /// What was mended or left out while reading.
    pub notes: Vec<String>,
    /// Format of the track.
    pub format: String,
}

impl Answer {
    /// Analyses the jumps on a track that was read from `path`, and compares the first with that of another jumper from
    /// the same load. Returns the analysis of the first jump too.
    ///
    /// # Errors
    /// Returns an error if there is no fall on one of the tracks, or the other cannot be read.
    pub fn of(
        track: Track,
        path: &Path,
        conditions: &Conditions,
        other: Option<&Path>,
    ) -> Result<(Self, Jump)> {
        let found = falls(&track, conditions, path)?;
        let mut jumps = found.jumps.into_iter();
        let Some((mut report, jump)) = jumps.next() else {
            return Err(Problem::internal("a track without jumps was accepted"));
        };
        report.beside = other
            .map(|other| beside(other, conditions, &jump))
            .transpose()?;
        let answer = Self {
            report,
            other_jumps: jumps.map(|(report, _)| report).collect(),
            channels: found.channels,
            notes: track.notes,
            format: track.format.to_owned(),
        };
        Ok((answer, jump))
    }

    /// Why the first jump is not explained or not certain, or the comparison fails; `None` if all is well. `path` and
    /// `other` are the tracks.
    pub fn failure(&self, path: &Path, other: Option<&Path>) -> Option<Problem> {
        let report = &self.report;
        match report.verdict {
            Verdict::Unexplained => {
                return Some(Problem::disagreement(report.reason.clone()).in_file(path));
            }
            Verdict::Uncertain => return Some(Problem::doubt(report.reason.clone()).in_file(path)),
            Verdict::Explained | Verdict::Thin => {}
        }
        let beside = report.beside.as_ref().filter(|beside| !beside.agrees())?;
        let apart = beside.winds_apart.unwrap_or(f64::NAN);
        let message = format!(
            "the winds of both falls are {apart:.1} deviations apart: they are not from one load, or one jumper steered"
        );
        Some(Problem::disagreement(message).in_file(other.unwrap_or(path)))
    }
}
