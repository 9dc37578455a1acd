//! An instant of a flight, as far as a load may depend on it.

use nalgebra::Vector3;

use crate::body::posture::Posture;
use crate::dynamics::Motion;
use crate::math::Real;

/// An axis of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Axis {
    /// The first.
    X,
    /// The second.
    Y,
    /// The third.
    Z,
}

impl Axis {
    /// All three.
    pub const ALL: [Self; 3] = [Self::X, Self::Y, Self::Z];

    /// The component along it.
    pub fn of<T: Real>(self, vector: &Vector3<T>) -> T {
        match self {
            Self::X => vector.x,
            Self::Y => vector.y,
            Self::Z => vector.z,
        }
    }

    /// The unit vector along it.
    pub fn unit<T: Real>(self) -> Vector3<T> {
        match self {
            Self::X => Vector3::x(),
            Self::Y => Vector3::y(),
            Self::Z => Vector3::z(),
        }
    }
}

/// What a load may depend on at one instant.
pub struct Instant<'a, T: Real> {
    /// Since the start of the flight (s).
    pub time: T,
    /// Motion of the body.
    pub motion: &'a Motion<T>,
    /// Its posture.
    pub posture: &'a Posture<T>,
    /// Velocity through the air (m/s), body axes.
    pub through_air: Vector3<T>,
}
