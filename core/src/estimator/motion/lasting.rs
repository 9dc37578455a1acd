//! Errors that last for seconds, so that no mean removes them: of an attitude sensor, of a receiver's velocity, and of the
//! muscle input after a motion that was wrong.
//!
//! They are considered rather than estimated: the filter follows such a sensor, and what it states includes the error. A
//! motion that was given up leaves moments behind which the filter divides among muscles and residual load; what of it is
//! wrong fades as the inputs do.

use super::measurement::SensorMeasurement;
use super::state::{ATTITUDE, Difference, MUSCLE, VELOCITY};
use crate::math::{Real, flushed};

/// Largest error of a receiver that is considered (m/s): solutions beyond it hardly move the estimate.
const LARGEST: f32 = 1.0;

/// Error of the muscle input right after a motion was given up, and the time in which it fades (s).
const LEFT: f32 = 1.0;
const FADES: f32 = 4.0;

/// Variances of the errors that last.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Lasting<T> {
    /// Of the attitude, each axis (rad2).
    attitude: T,
    /// Of the velocity, horizontal and vertical (m2/s2).
    velocity: [T; 2],
    /// Of the muscle input, each axis.
    muscle: T,
}

impl<T: Real> Lasting<T> {
    /// Before anything is measured.
    pub(super) fn new() -> Self {
        Self {
            attitude: T::zero(),
            velocity: [T::zero(); 2],
            muscle: T::zero(),
        }
    }

    /// After a restart: inputs that are kept have what an earlier motion left in them, and `fresh` ones have nothing.
    pub(super) fn restarted(&self, is_fresh: bool) -> Self {
        let muscle = if is_fresh { T::zero() } else { self.muscle };
        Self {
            muscle,
            ..Self::new()
        }
    }

    /// Passes an interval of `duration` (s); `is_left` says whether the motion was given up in it.
    pub(super) fn pass(&mut self, is_left: bool, duration: T) {
        let faded = self.muscle * (T::of(2.0) * duration / T::single(FADES));
        self.muscle = if is_left {
            T::single(LEFT * LEFT)
        } else {
            flushed(self.muscle - faded)
        };
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
            variances[MUSCLE + k] += self.muscle;
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

    #[test]
    fn what_a_wrong_motion_leaves_in_the_muscle_input_fades() {
        let mut lasting = Lasting::<f64>::new();
        lasting.pass(true, 0.01);
        for (seconds, right) in [(0, 1.0), (4, 0.37), (4, 0.135)] {
            (0..seconds * 100).for_each(|_| lasting.pass(false, 0.01));
            let mut variances = Difference::zeros();
            lasting.add_to(&mut variances);
            assert!(
                (variances[MUSCLE].sqrt() - right).abs() < 0.01,
                "{variances}"
            );
        }
        // A restart that keeps the inputs keeps it too.
        assert_eq!(lasting.restarted(false), lasting);
        assert_eq!(lasting.restarted(true), Lasting::new());
        (0..100_000).for_each(|_| lasting.pass(false, 0.01));
        assert_eq!(lasting, Lasting::new());
    }
}
