//! The result of a search for coefficients.

use serde::Serialize;

use bodyflight_replay::comparison::PerChannel;
use bodyflight_replay::subject::CommonCoefficients;

/// Coefficients of one segment.
#[derive(Debug, Clone, Copy, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SegmentBest {
    /// Name of the segment.
    pub segment: &'static str,
    /// Drag.
    pub cd: f64,
    /// Lift, the force across the airflow.
    pub cl: f64,
    /// Moment.
    pub cm: f64,
}

/// The result of a search.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Initial coefficients.
    pub guess: CommonCoefficients,
    /// The best draw.
    pub best: CommonCoefficients,
    /// Coefficients of segments that differ from the common ones: from a search per segment, or the subject's, scaled.
    pub segments: Vec<SegmentBest>,
    /// Gap of the guess on the flights used, in units of the paper's accuracy.
    pub score_before: f64,
    /// Gap of the best draw, in the same units.
    pub score_after: f64,
    /// Flights that were not used.
    pub held_out: Vec<HeldOut>,
    /// Number of draws simulated.
    pub draws: usize,
    /// Whether Ctrl-C ended the search: the best is that of the draws so far, and was not checked on held-out flights.
    pub interrupted: bool,
    /// Reasons not to trust the best.
    pub doubts: Vec<String>,
    /// What is implausible in the recordings, none of which contradicts itself.
    pub warnings: Vec<String>,
}

impl Report {
    /// Why the best should not be trusted, in a sentence.
    pub fn doubt(&self) -> Option<String> {
        (!self.doubts.is_empty()).then(|| self.doubts.join("; "))
    }
}

/// Why the best should not be trusted, if the gap that it leaves on the flights used is more than the accuracy of the
/// method.
pub(super) fn gap_left(score: f64) -> Option<String> {
    (score > 1.0).then(|| {
        format!(
            "with the best coefficients the gap is still {score:.1} times the paper's accuracy: coefficients alone do not \
             explain the flights used"
        )
    })
}

/// A flight that was not used in the search.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct HeldOut {
    /// The recording.
    pub recording: String,
    /// Gap with the guess.
    pub rms_before: PerChannel,
    /// Gap with the best.
    pub rms_after: PerChannel,
    /// Score with the guess.
    pub score_before: f64,
    /// Score with the best.
    pub score_after: f64,
    /// Why the score with the best means nothing, if the simulation diverges.
    pub diverged: Option<String>,
}

impl HeldOut {
    /// Why the best should not be trusted, if this flight says so.
    pub(super) fn doubt(&self) -> Option<String> {
        let [before, after] = [self.score_before, self.score_after];
        match &self.diverged {
            Some(diverged) => Some(format!(
                "on {}, which was held out, {diverged}",
                self.recording
            )),
            None if after > before => Some(format!(
                "on {}, which was held out, the gap grows from {before:.3} to {after:.3}: the coefficients fit only the flights used",
                self.recording
            )),
            None => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn held_out(score_after: f64, diverged: Option<String>) -> Option<String> {
        let none = PerChannel::default();
        let held_out = HeldOut {
            recording: "turn-3".to_owned(),
            rms_before: none,
            rms_after: none,
            score_before: 2.0,
            score_after,
            diverged,
        };
        held_out.doubt()
    }

    #[test]
    fn a_best_that_leaves_a_gap_is_doubted() {
        assert_eq!(gap_left(0.98), None);
        let doubt = gap_left(2.589).unwrap();
        assert!(
            doubt.contains("still 2.6 times the paper's accuracy"),
            "{doubt}"
        );
    }

    #[test]
    fn a_best_that_fails_on_a_flight_held_out_is_doubted() {
        assert_eq!(held_out(1.5, None), None);
        let worse = held_out(2.5, None).unwrap();
        assert!(
            worse.contains("turn-3, which was held out, the gap grows from 2.000 to 2.500"),
            "{worse}"
        );
        let diverged = held_out(1.0, Some("the simulation diverges".to_owned())).unwrap();
        assert!(
            diverged.contains("held out, the simulation diverges"),
            "{diverged}"
        );
    }
}
