//! Compares two jumpers from the same load, who fell through the same wind.

use serde::Serialize;

/// Number of standard deviations beyond which two winds are not from the same load.
pub const MOST_APART: f64 = 3.0;

/// The other jumper's fall, and how its wind agrees.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Beside {
    /// Speed downwards in the steady part, at the reference height of the standard atmosphere (m/s).
    pub normalised_rate_mps: f64,
    /// Difference between the winds of both falls (standard deviations of both, root mean square over the heights);
    /// `None` if one fall does not show the wind.
    pub winds_apart: Option<f64>,
    /// Number of heights compared.
    pub heights: usize,
}

impl Beside {
    /// Whether the winds are compatible with one load, as far as they are known.
    pub fn agrees(&self) -> bool {
        self.winds_apart.is_none_or(|apart| apart <= MOST_APART)
    }
}
