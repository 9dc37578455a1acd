//! The range that a reconstructed motion is kept in.

use crate::dynamics::State;
use crate::dynamics::interval::Interval;
use crate::math::Real;

/// Largest speed of the reconstructed motion (m/s) and largest angular velocity (rad/s); beyond them it is
/// limited.
pub const MOTION_LIMITS: [f32; 2] = [100.0, 35.0];

/// Limits speed and angular velocity to [`MOTION_LIMITS`]; whether that changed anything.
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
