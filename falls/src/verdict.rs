//! Decides whether a fall is explained, and gives the reason.

use serde::Serialize;

use crate::drag::Piece;

/// Shortest fall that is judged (s).
pub const LEAST: f64 = 8.0;

/// Fewest seconds with a drag estimate in a fall that is judged.
const LEAST_BLOCKS: usize = 6;

/// Largest difference between the measured and the simulated fall: root mean square of the vertical velocity, as a
/// fraction of the speed.
const LARGEST_GAP: f64 = 0.06;

/// Plausible drag factors of a body or a wingsuit (m2/kg): from a speed skydiver to a wide suit on a light person.
pub const PLAUSIBLE: [f64; 2] = [0.000_9, 0.016];

/// Whether the fall is explained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// A simulation with plausible drag, lift and wind reproduces the fall.
    Explained,
    /// The fall is too short to be judged.
    Thin,
    /// No plausible drag, lift and wind reproduce the fall.
    Unexplained,
    /// It is not certain that this part of the track is a fall.
    Uncertain,
}

impl Verdict {
    /// Name for people.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Explained => "explained",
            Self::Thin => "thin",
            Self::Unexplained => "unexplained",
            Self::Uncertain => "uncertain",
        }
    }
}

/// The numbers by which a fall is judged.
#[derive(Debug, Clone, Copy)]
pub struct Evidence<'a> {
    /// Length of the fall (s).
    pub duration: f64,
    /// Start of the fall (s).
    pub begin: f64,
    /// Number of seconds with a drag estimate.
    pub seconds: usize,
    /// Its pieces of constant posture.
    pub pieces: &'a [Piece],
    /// Difference from the simulated fall: root mean square of the vertical velocity (m/s).
    pub gap: f64,
    /// Mean speed (m/s).
    pub speed: f64,
    /// Why the phases are not certain, in a clause; `None` if they are.
    pub doubt: Option<&'a str>,
}

/// Returns the verdict and the reason.
pub fn judged(evidence: &Evidence<'_>) -> (Verdict, String) {
    if let Some(doubt) = evidence.doubt {
        return (
            Verdict::Uncertain,
            format!("it is not certain that this is a fall: {doubt}"),
        );
    }
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
