//! What sensors make of a motion: the effects that act on the recording.

use nalgebra::{UnitQuaternion, Vector3};

use crate::dynamics::Motion;
use crate::frame::{Body as BodyFrame, Inertial, Rotation, Vector};
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
    /// Velocity added from the start (m/s), to the position too.
    pub velocity_offset: Vector<T, Inertial>,
    /// Time by which postures are recorded too late (s). Who flies the model reads postures that much later.
    pub posture_delay: T,
    /// Time by which the velocity is measured too late (s).
    pub velocity_latency: T,
    /// Time by which the angular velocity is measured too late (s).
    pub rate_lag: T,
}

/// The part of a motion that sensors may report late.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moving<T: Real> {
    /// Velocity (m/s).
    pub velocity: Vector<T, Inertial>,
    /// Angular velocity (rad/s).
    pub angular_velocity: Vector<T, BodyFrame>,
}

impl<T: Real> Moving<T> {
    /// Of a motion.
    pub fn of(motion: &Motion<T>) -> Self {
        Self {
            velocity: motion.velocity_inertial(),
            angular_velocity: motion.angular_velocity,
        }
    }

    /// On the line through this and `other`, `share` of the way; beyond the ends too.
    pub fn towards(&self, other: &Self, share: T) -> Self {
        let line = |from: Vector3<T>, to: Vector3<T>| from + (to - from) * share;
        Self {
            velocity: Vector::from_components(line(
                self.velocity.components,
                other.velocity.components,
            )),
            angular_velocity: Vector::from_components(line(
                self.angular_velocity.components,
                other.angular_velocity.components,
            )),
        }
    }
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

    /// What is measured of `motion`, `time` (s) after the start of the flight. `past` gives the moving a delay (s)
    /// earlier, later where negative; it is asked only for what is late.
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
        let velocity =
            at(self.velocity_latency).velocity.components + self.velocity_offset.components;
        let spin = at(self.rate_lag).angular_velocity.components;
        let mounting: UnitQuaternion<T> = small_rotation(&self.mounting);
        let up = Vector3::new(T::zero(), T::zero(), self.heading_drift * time);
        let attitude = small_turns(&up) * motion.inertial_from_body.quaternion() * mounting;
        let inertial_from_body = Rotation::from_quaternion(attitude);
        Motion {
            inertial_from_body,
            // What misses a velocity from the start misses the way that it makes.
            position: Vector::from_components(
                motion.position.components + self.velocity_offset.components * time,
            ),
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
