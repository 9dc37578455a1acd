//! What sensors make of a motion: the effects that act on the recording.

use nalgebra::{UnitQuaternion, Vector3};

use crate::dynamics::Motion;
use crate::frame::{Inertial, Rotation, Vector};
use crate::math::{Real, small_rotation};

/// Errors of the sensors; zero is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensors<T: Real> {
    /// Turn of the measured body axes about X, Y, Z (rad), small.
    pub mounting: Vector3<T>,
    /// Angular velocity added (rad/s), body axes.
    pub gyro_bias: Vector3<T>,
    /// Rate at which the heading drifts (rad/s).
    pub heading_drift: T,
    /// Velocity added (m/s).
    pub velocity_offset: Vector<T, Inertial>,
    /// Time by which postures are recorded too late (s). Who flies the model reads postures that much later.
    pub posture_delay: T,
    /// Time by which the velocity is measured too late (s).
    pub velocity_latency: T,
    /// Time by which the angular velocity is measured too late (s).
    pub rate_lag: T,
}

impl<T: Real> Sensors<T> {
    /// Sensors without error.
    pub fn perfect() -> Self {
        Self {
            mounting: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            heading_drift: T::zero(),
            velocity_offset: Vector::zero(),
            posture_delay: T::zero(),
            velocity_latency: T::zero(),
            rate_lag: T::zero(),
        }
    }

    /// What is measured of `motion`, `time` (s) after the start of the flight. `before` is the motion `interval`
    /// (s) earlier: a delay is its first-order form, by the rate of change between the two.
    pub fn observe(
        &self,
        motion: &Motion<T>,
        before: &Motion<T>,
        interval: T,
        time: T,
    ) -> Motion<T> {
        if *self == Self::perfect() {
            return *motion;
        }
        let back = |now: Vector3<T>, then: Vector3<T>, delay: T| {
            if interval > T::zero() {
                now - (now - then) * (delay / interval)
            } else {
                now
            }
        };
        let velocity = back(
            motion.velocity_inertial().components,
            before.velocity_inertial().components,
            self.velocity_latency,
        ) + self.velocity_offset.components;
        let spin = back(
            motion.angular_velocity.components,
            before.angular_velocity.components,
            self.rate_lag,
        );
        let mounting: UnitQuaternion<T> = small_rotation(&self.mounting);
        let up = Vector3::new(T::zero(), T::zero(), self.heading_drift * time);
        let attitude = small_turns(&up) * motion.inertial_from_body.quaternion() * mounting;
        let inertial_from_body = Rotation::from_quaternion(attitude);
        Motion {
            inertial_from_body,
            position: motion.position,
            velocity: inertial_from_body.inverse() * Vector::from_components(velocity),
            angular_velocity: Vector::from_components(mounting.inverse() * spin + self.gyro_bias),
        }
    }
}

/// A turn of any size, from small ones.
fn small_turns<T: Real>(turn: &Vector3<T>) -> UnitQuaternion<T> {
    let (sine, cosine) = (turn.z * T::of(0.5)).sine_cosine();
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(
        cosine,
        T::zero(),
        T::zero(),
        sine,
    ))
}
