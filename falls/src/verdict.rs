//! Whether a fall is explained: what it takes, and the sentence that says why.

use schemars::JsonSchema;
use serde::Serialize;

use crate::drag::Piece;

/// Shortest fall that is judged (s).
pub const LEAST: f64 = 8.0;

/// Fewest seconds of a fall in which drag was told.
const LEAST_BLOCKS: usize = 6;

/// Largest gap between the fall and the fall flown again, root mean square of the vertical velocity: share of the speed.
const LARGEST_GAP: f64 = 0.06;

/// Drag factors that a body or a wingsuit can have (m2/kg): a diver of speed to a wide suit on a light person.
pub const PLAUSIBLE: [f64; 2] = [0.000_9, 0.016];

/// Whether the fall is explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// Drag, lift and wind that a body can have fly the fall again.
    Explained,
    /// Too short to be judged.
    Thin,
    /// Nothing that a body can have flies it.
    Unexplained,
}

/// What a fall is judged by.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// Length of the fall (s).
    pub duration: f64,
    /// When it begins (s).
    pub begin: f64,
    /// Seconds of it in which drag was told.
    pub seconds: usize,
    /// Its pieces of one posture.
    pub pieces: &'a [Piece],
    /// Gap to the fall flown again, root mean square of the vertical velocity (m/s).
    pub gap: f64,
    /// Mean speed (m/s).
    pub speed: f64,
}

/// The verdict, and why.
pub fn judged(evidence: &Evidence<'_>) -> (Verdict, String) {
    let duration = evidence.duration;
    if duration < LEAST || evidence.seconds < LEAST_BLOCKS {
        return (
            Verdict::Thin,
            format!(
                "{duration:.1} s of fall with {} usable seconds; {LEAST} s and {LEAST_BLOCKS} are needed",
                evidence.seconds
            ),
        );
    }
    let odd = evidence.pieces.iter().find(|piece| {
        piece.drag + 2.0 * piece.deviation < PLAUSIBLE[0]
            || piece.drag - 2.0 * piece.deviation > PLAUSIBLE[1]
    });
    if let Some(piece) = odd {
        return (
            Verdict::Unexplained,
            format!(
                "from {:.1} to {:.1} s after the start of the fall, area times drag coefficient over mass is {:.5} m2/kg, \
                 which no body has ({:.4} to {:.4})",
                piece.time[0] - evidence.begin,
                piece.time[1] - evidence.begin,
                piece.drag,
                PLAUSIBLE[0],
                PLAUSIBLE[1]
            ),
        );
    }
    let share = evidence.gap / evidence.speed.max(1.0);
    if share > LARGEST_GAP {
        return (
            Verdict::Unexplained,
            format!(
                "flown again with the drag, lift and wind found, the vertical velocity is {:.1} m/s off, {:.0} % of the speed",
                evidence.gap,
                100.0 * share
            ),
        );
    }
    (
        Verdict::Explained,
        format!(
            "flown again with {} drag {} and the wind found, the vertical velocity is {:.1} m/s off, {:.1} % of the speed",
            evidence.pieces.len(),
            if evidence.pieces.len() == 1 {
                "area"
            } else {
                "areas"
            },
            evidence.gap,
            100.0 * share
        ),
    )
}
