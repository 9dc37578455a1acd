//! Errors of the sensors: the effects that change the recording rather than the motion.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use crate::dynamics::Motion;
use crate::frame::{Body as BodyFrame, Inertial, Rotation, Vector};
use crate::math::{Real, small_rotation};

/// Errors of the sensors; zero means none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors<T: Real> {
    /// Rotation of the measured body axes about X, Y, Z (rad); must be small.
    pub mounting: Vector3<T>,
    /// Offset of the measured angular velocity (rad/s).
    pub gyro_bias: Vector<T, BodyFrame>,
    /// Rate at which the measured heading drifts (rad/s), positive from north towards west.
    pub heading_drift: T,
    /// Constant offset of the measured velocity (m/s); the measured position drifts accordingly.
    pub velocity_offset: Vector<T, Inertial>,
    /// Time by which postures are recorded late (s). The model must be run with postures read this much later.
    pub posture_delay: T,
    /// Time by which the velocity is measured late (s).
    pub velocity_latency: T,
    /// Time by which the angular velocity is measured late (s).
    pub rate_lag: T,
}

/// The quantities of a motion that sensors may report late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving<T: Real> {
    /// Velocity (m/s).
    pub velocity: Vector<T, Inertial>,
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector<T, BodyFrame>,
}

impl<T: Real> Moving<T> {
    /// Extracts the quantities from a motion.
    pub fn of(motion: &Motion<T>) -> Self {
        Self {
            velocity: motion.velocity_inertial(),
            angular_velocity: motion.angular_velocity,
        }
    }

    /// Interpolates linearly towards `other` by `share`; shares outside 0 to 1 extrapolate.
    pub fn towards(&self, other: &Self, share: T) -> Self {
        Self {
            velocity: self.velocity.towards(&other.velocity, share),
            angular_velocity: self
                .angular_velocity
                .towards(&other.angular_velocity, share),
        }
    }
}

impl<T: Real> Sensors<T> {
    /// Sensors without errors.
    pub fn perfect() -> Self {
        Self {
            mounting: Vector3::zeros(),
            gyro_bias: Vector::zero(),
            heading_drift: T::zero(),
            velocity_offset: Vector::zero(),
            posture_delay: T::zero(),
            velocity_latency: T::zero(),
            rate_lag: T::zero(),
        }
    }

    /// Returns the measurement of `motion`, `time` (s) after the start of the flight. `past` returns the quantities as
    /// they were a given time (s) earlier, or later if that time is negative; it is called only for quantities with a
    /// delay.
    pub fn observe(&self, motion: &Motion<T>, past: impl Fn(T) -> Moving<T>, time: T) -> Motion<T> {
        if *self == Self::perfect() {
            return *motion;
        }
        let at = |delay: T| {
            if delay == T::zero() {
                Moving::of(motion)
            } else {
                past(delay)
            }
        };
        let velocity = at(self.velocity_latency).velocity + self.velocity_offset;
        let spin = at(self.rate_lag).angular_velocity;
        let body_from_measured =
            Rotation::<T, BodyFrame, BodyFrame>::from_quaternion(small_rotation(&self.mounting));
        let drifted = turn_about_up(self.heading_drift * time);
        let inertial_from_body = drifted * motion.inertial_from_body * body_from_measured;
        Motion {
            inertial_from_body,
            // A constant velocity offset accumulates in the position.
            position: motion.position + self.velocity_offset * time,
            velocity: inertial_from_body.inverse() * velocity,
            angular_velocity: body_from_measured.inverse() * spin + self.gyro_bias,
        }
    }
}

impl<T: Real> Sensors<T> {
    /// Returns the motion that was measured as `seen`, `time` (s) after the start of the flight: the inverse of
    /// [`Sensors::observe`] except for delays.
    pub fn corrected(&self, seen: &Motion<T>, time: T) -> Motion<T> {
        let body_from_measured =
            Rotation::<T, BodyFrame, BodyFrame>::from_quaternion(small_rotation(&self.mounting));
        let drifted = turn_about_up(self.heading_drift * time);
        let inertial_from_body =
            drifted.inverse() * seen.inertial_from_body * body_from_measured.inverse();
        let velocity = seen.velocity_inertial() - self.velocity_offset;
        Motion {
            inertial_from_body,
            position: seen.position - self.velocity_offset * time,
            velocity: inertial_from_body.inverse() * velocity,
            angular_velocity: body_from_measured * (seen.angular_velocity - self.gyro_bias),
        }
    }
}

/// Rotation about the vertical by an angle of any size (rad), positive from north towards west.
fn turn_about_up<T: Real>(angle: T) -> Rotation<T, Inertial, Inertial> {
    let (sine, cosine) = (angle * T::of(0.5)).sine_cosine();
    let turn = Quaternion::new(cosine, T::zero(), T::zero(), sine);
    Rotation::from_quaternion(UnitQuaternion::new_unchecked(turn))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn correcting_inverts_observing(
            q in prop::array::uniform4(-1.0f64..1.0),
            moving in prop::array::uniform6(-20.0f64..20.0),
            errors in prop::array::uniform6(-0.1f64..0.1),
            time in 0.0f64..60.0,
        ) {
            let Some(inertial_from_body) = Rotation::from_wxyz(q) else {
                return Ok(());
            };
            let motion = Motion {
                inertial_from_body,
                position: Vector::new(1.0, 2.0, 3.0),
                velocity: Vector::new(moving[0], moving[1], moving[2]),
                angular_velocity: Vector::new(moving[3], moving[4], moving[5]),
            };
            let sensors = Sensors {
                mounting: Vector3::new(errors[0], errors[1], errors[2]),
                gyro_bias: Vector::new(errors[3], errors[4], errors[5]),
                heading_drift: errors[0],
                velocity_offset: Vector::new(errors[1] * 50.0, errors[2] * 50.0, errors[3] * 50.0),
                ..Sensors::perfect()
            };
            let seen = sensors.observe(&motion, |_| Moving::of(&motion), time);
            let back = sensors.corrected(&seen, time);
            prop_assert!((back.velocity - motion.velocity).norm() < 1e-9);
            prop_assert!((back.position - motion.position).norm() < 1e-9);
            let spin = back.angular_velocity - motion.angular_velocity;
            prop_assert!(spin.norm() < 1e-9);
            let turn = back.inertial_from_body.inverse() * motion.inertial_from_body;
            prop_assert!(turn.quaternion().angle() < 1e-7);
        }
    }
}
