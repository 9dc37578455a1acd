//! Limits of the reconstructed motion.

use crate::dynamics::State;
use crate::dynamics::interval::Interval;
use crate::math::Real;

/// Maximum speed (m/s) and maximum angular velocity (rad/s) of the reconstructed motion; larger values are clamped.
pub const MOTION_LIMITS: [f32; 2] = [100.0, 35.0];

/// Clamps speed and angular velocity to [`MOTION_LIMITS`]; returns whether anything changed.
pub(super) fn limit<T: Real>(state: &mut State<T>, interval: &impl Interval<T>) -> bool {
    let mut motion = state.motion(interval);
    let mut changed = false;
    let vectors = [&mut motion.velocity, &mut motion.angular_velocity];
    for (vector, limit) in vectors.into_iter().zip(MOTION_LIMITS) {
        let ratio = vector.norm() / T::single(limit);
        if ratio > T::one() {
            *vector /= ratio;
            changed = true;
        }
    }
    if changed {
        *state = State::from_motion(&motion, interval);
    }
    changed
}
