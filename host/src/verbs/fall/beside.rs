//! Two people of one load: they fell through the same wind.

use schemars::JsonSchema;
use serde::Serialize;

/// Deviations from which on two winds are not of one load.
pub const MOST_APART: f64 = 3.0;

/// The other jumper's fall, and how its wind agrees.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Beside {
    /// Speed downwards in the steady part, at the reference height of the standard atmosphere (m/s).
    pub normalised_rate_mps: f64,
    /// How far the winds of both falls are apart (deviations of both, root mean square over the heights); `None` where one of
    /// them says nothing of the wind.
    pub winds_apart: Option<f64>,
    /// Heights that were compared.
    pub heights: usize,
}

impl Beside {
    /// Whether the winds are those of one load, as far as they are told.
    pub fn agrees(&self) -> bool {
        self.winds_apart.is_none_or(|apart| apart <= MOST_APART)
    }
}
