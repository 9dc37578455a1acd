//! What sensors other than a suit measure: a satellite receiver, a barometer, a gyroscope and an accelerometer.
//!
//! Each value carries its own standard deviation, because these sensors state it or differ from part to part, and the
//! receiver its age, because its solution arrives a tenth of a second or more after the instant it describes.

use crate::frame::{Body, Inertial, Vector};
use crate::math::Real;

/// Ratio of a receiver's vertical deviation to the one that it states: satellites are above only.
pub const VERTICAL_RATIO: f32 = 1.5;

/// Velocity from satellites.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReceiverVelocity<T: Real> {
    /// Velocity of the antenna over the ground (m/s).
    pub velocity: Vector<T, Inertial>,
    /// Standard deviation of each horizontal component (m/s), as the receiver states it.
    pub horizontal_deviation: T,
    /// Standard deviation of the vertical component (m/s).
    pub vertical_deviation: T,
    /// Time from the instant that the solution describes to the sample that carries it (s).
    pub age: T,
    /// Position of the antenna relative to the pelvic joint (m).
    pub arm: Vector<T, Body>,
}

/// A barometer's height, its vertical velocity, or both.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Barometer<T: Real> {
    /// Height above any fixed level (m). The filter uses its change over about a second.
    pub height: Option<T>,
    /// Standard deviation of the height's noise (m).
    pub height_deviation: T,
    /// Vertical velocity, upward (m/s).
    pub vertical_velocity: Option<T>,
    /// Standard deviation of the vertical velocity (m/s).
    pub vertical_velocity_deviation: T,
}

/// Angular velocity of a gyroscope, not corrected by the sensor for its bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gyroscope<T: Real> {
    /// Angular velocity as read, in body axes (rad/s).
    pub angular_velocity: Vector<T, Body>,
    /// Standard deviation of its noise, each axis (rad/s).
    pub deviation: T,
}

/// Specific force of an accelerometer: acceleration minus gravity. In a steady fall it is the force of the air divided
/// by the mass, one g upward; in a free fall without air it is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpecificForce<T: Real> {
    /// Specific force in body axes (m/s2).
    pub force: Vector<T, Body>,
    /// Standard deviation of each axis (m/s2), vibration included.
    pub deviation: T,
    /// Position of the sensor relative to the pelvic joint (m).
    pub arm: Vector<T, Body>,
}

impl<T: Real> ReceiverVelocity<T> {
    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> ReceiverVelocity<U> {
        let scalar = |value: T| U::of(value.to_f64());
        ReceiverVelocity {
            velocity: self.velocity.cast(),
            horizontal_deviation: scalar(self.horizontal_deviation),
            vertical_deviation: scalar(self.vertical_deviation),
            age: scalar(self.age),
            arm: self.arm.cast(),
        }
    }
}

impl<T: Real> Barometer<T> {
    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> Barometer<U> {
        let scalar = |value: T| U::of(value.to_f64());
        Barometer {
            height: self.height.map(scalar),
            height_deviation: scalar(self.height_deviation),
            vertical_velocity: self.vertical_velocity.map(scalar),
            vertical_velocity_deviation: scalar(self.vertical_velocity_deviation),
        }
    }
}

impl<T: Real> Gyroscope<T> {
    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> Gyroscope<U> {
        Gyroscope {
            angular_velocity: self.angular_velocity.cast(),
            deviation: U::of(self.deviation.to_f64()),
        }
    }
}

impl<T: Real> SpecificForce<T> {
    /// Converts the values to another precision.
    pub fn cast<U: Real>(&self) -> SpecificForce<U> {
        SpecificForce {
            force: self.force.cast(),
            deviation: U::of(self.deviation.to_f64()),
            arm: self.arm.cast(),
        }
    }
}
