//! One instant of a recorded or simulated flight.

use crate::Posture;
use crate::dynamics::Motion;

/// One instant of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightSample {
    /// Time (s).
    pub time: f64,
    /// Recorded posture.
    pub posture: Posture<f64>,
    /// Recorded motion of the pelvis.
    pub motion: Motion<f64>,
}
