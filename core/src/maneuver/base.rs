//! Building blocks of the scripts.

use core::f64::consts::FRAC_PI_2;

use super::Maneuver;
use crate::aerodynamics::BELLY_TURN_DAMPING;
use crate::axis::AxisCoefficients;
use crate::body::pattern::NEUTRAL;
use crate::dynamics::muscle_input::BACK_TRACKING;

/// Returns coefficients about the axes X, Y and Z of the body.
pub(super) const fn about(pitch: f64, yaw: f64, roll: f64) -> AxisCoefficients<f64> {
    AxisCoefficients::new(pitch, yaw, roll)
}

/// Neutral fall, the basis of the other scripts.
pub(super) const BELLY: Maneuver = Maneuver {
    name: "neutral-fall",
    summary: "falls straight down in the neutral pose",
    duration: 30.0,
    base: NEUTRAL,
    start_pitch: FRAC_PI_2,
    start_speed: 1.0,
    start_forward: 0.0,
    tracks: &[],
    muscle: &[],
    damping: &[(0.0, BELLY_TURN_DAMPING)],
    muscles: BACK_TRACKING,
};
