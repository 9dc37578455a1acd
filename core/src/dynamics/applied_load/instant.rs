//! The conditions at one instant of a flight that a load may depend on.

use nalgebra::Vector3;

use crate::body::posture::Posture;
use crate::dynamics::Motion;
use crate::math::Real;

/// An axis of a frame. A segment's axes are parallel to the body's in the H-pose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// First axis: left in the body frame, north in the inertial frame.
    X,
    /// Second axis: dorsal (back) in the body frame, west in the inertial frame.
    Y,
    /// Third axis: cranial (head) in the body frame, up in the inertial frame.
    Z,
}

impl Axis {
    /// All three axes.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// Returns the component of `vector` along this axis.
    pub fn of<T: Real>(self, vector: &Vector3<T>) -> T {
        match self {
            Self::X => vector.x,
            Self::Y => vector.y,
            Self::Z => vector.z,
        }
    }

    /// Returns the unit vector along this axis.
    pub fn unit<T: Real>(self) -> Vector3<T> {
        match self {
            Self::X => Vector3::x(),
            Self::Y => Vector3::y(),
            Self::Z => Vector3::z(),
        }
    }
}

/// Everything a load may depend on at one instant.
pub struct Instant<'a, T: Real> {
    /// Time since the start of the flight (s).
    pub time: T,
    /// Motion of the body.
    pub motion: &'a Motion<T>,
    /// Posture of the body.
    pub posture: &'a Posture<T>,
    /// Velocity of the body through the air (m/s), body axes.
    pub through_air: Vector3<T>,
}
