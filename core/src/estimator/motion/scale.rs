//! The error of a gyroscope's scale: it is proportional to the angular velocity and stays, so no mean removes it.
//!
//! It is considered rather than estimated: only a measured attitude tells it, and with one it does little harm. A rate is
//! the less worth the faster it is, the stated angular velocity has the error as a whole, and an attitude that is only
//! integrated drifts with it.

use nalgebra::Vector3;

use super::settings::MotionPreset;
use crate::math::Real;

/// Time over which a rotation about an axis goes on (s), so that the errors of the attitude add up.
const PERSISTENT: f64 = 5.0;

/// Variances of the error of the scale, as squares of shares.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale<T: Real> {
    /// Of an angular velocity that its sensor has corrected, and of a gyroscope as read.
    variances: [T; 2],
    /// Which of them was fused last.
    is_read: bool,
}

impl<T: Real> Scale<T> {
    pub(super) fn new(preset: &MotionPreset) -> Self {
        Self {
            variances: preset
                .rate_scale
                .map(|share| T::single(share) * T::single(share)),
            is_read: false,
        }
    }

    /// Notes whether the angular velocity is one of a gyroscope as read.
    pub(super) fn concern(&mut self, is_read: bool) {
        self.is_read = is_read;
    }

    /// Variance of the angular velocity about each axis ((rad/s)2) at `spin` (rad/s).
    pub(super) fn variance(&self, spin: &Vector3<T>) -> Vector3<T> {
        let [corrected, read] = self.variances;
        let variance = if self.is_read { read } else { corrected };
        spin.map(|along| variance * along * along)
    }

    /// Variance by which an attitude that is not measured grows about each axis (rad2) in an interval of `duration` (s).
    pub(super) fn drift(&self, spin: &Vector3<T>, duration: T) -> Vector3<T> {
        self.variance(spin) * (T::of(2.0 * PERSISTENT) * duration)
    }
}

#[cfg(test)]
mod tests {
    use super::super::settings::MOTION;
    use super::*;

    #[test]
    fn an_attitude_drifts_at_least_as_its_scale_lets_it() {
        let mut scale = Scale::<f64>::new(&MOTION);
        let spin = Vector3::new(0.0, -3.0, 1.0);
        // A suit's angular velocity comes from its attitudes.
        assert!(scale.drift(&spin, 0.01).norm() <= 0.0);
        scale.concern(true);
        let error = f64::from(MOTION.rate_scale[1]) * 3.0;
        assert!((scale.variance(&spin).y.sqrt() - error).abs() < 1e-9);
        for seconds in [1.0, 3.0, 10.0] {
            let drift = scale.drift(&spin, 0.01) * (seconds / 0.01);
            assert!(drift.y.sqrt() >= error * seconds && drift.x <= 0.0);
        }
    }
}
