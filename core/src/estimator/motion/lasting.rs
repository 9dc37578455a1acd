//! Errors of sensors that last for seconds, so that no mean removes them: of an attitude, and of a receiver's velocity.
//!
//! They are considered rather than estimated: the filter follows such a sensor, and what it states includes the error.

use super::measurement::SensorMeasurement;
use super::state::{ATTITUDE, Difference, VELOCITY};
use crate::math::Real;

/// Largest error of a receiver that is considered (m/s): solutions beyond it hardly move the estimate.
const LARGEST: f32 = 1.0;

/// Variances of the errors that last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lasting<T> {
    /// Of the attitude, each axis (rad2).
    attitude: T,
    /// Of the velocity, horizontal and vertical (m2/s2).
    velocity: [T; 2],
}

impl<T: Real> Lasting<T> {
    /// Before anything is measured.
    pub(super) fn new() -> Self {
        Self {
            attitude: T::zero(),
            velocity: [T::zero(); 2],
        }
    }

    /// Takes what is measured: an error remains when its sensor falls silent.
    pub(super) fn take(&mut self, measured: &SensorMeasurement<T>) {
        if measured.motion.inertial_from_body.is_some() {
            self.attitude = measured.attitude_error * measured.attitude_error;
        }
        if measured.motion.velocity.is_some() {
            self.velocity = [T::zero(); 2];
        } else if let Some(receiver) = &measured.receiver {
            let most = T::single(LARGEST);
            self.velocity =
                [receiver.horizontal_deviation, receiver.vertical_deviation].map(|of| {
                    // The comparison is false for NaN.
                    let of = if of < most { of } else { most };
                    of * of
                });
        }
    }

    /// Adds them to the variances of a state.
    pub(super) fn add_to(&self, variances: &mut Difference<T>) {
        let [horizontal, vertical] = self.velocity;
        for k in 0..3 {
            variances[ATTITUDE + k] += self.attitude;
            variances[VELOCITY + k] += if k < 2 { horizontal } else { vertical };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::measurement::MotionMeasurement;
    use super::super::sensors::ReceiverVelocity;
    use super::*;
    use crate::frame::{Rotation, Vector};

    #[test]
    fn what_a_sensor_gets_wrong_stays_in_the_error_bars() {
        let mut lasting = Lasting::<f64>::new();
        let mut measured = SensorMeasurement::none();
        measured.motion.inertial_from_body = Some(Rotation::identity());
        measured.attitude_error = 0.03;
        measured.receiver = Some(ReceiverVelocity {
            velocity: Vector::zero(),
            horizontal_deviation: 0.2,
            vertical_deviation: 30.0,
            age: 0.1,
            arm: Vector::zero(),
        });
        lasting.take(&measured);
        lasting.take(&SensorMeasurement::none());
        let mut variances = Difference::zeros();
        lasting.add_to(&mut variances);
        let found = [0, 3, 4, 5].map(|k| variances[k].sqrt());
        for (found, right) in found.into_iter().zip([0.03, 0.2, 0.2, 1.0]) {
            assert!((found - right).abs() < 1e-12, "{found} {right}");
        }
        // A suit's are noise.
        let suit = MotionMeasurement {
            inertial_from_body: Some(Rotation::identity()),
            velocity: Some(Vector::zero()),
            ..MotionMeasurement::none()
        };
        lasting.take(&suit.into());
        assert_eq!(lasting, Lasting::new());
    }
}
