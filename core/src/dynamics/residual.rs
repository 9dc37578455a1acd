//! Loads that the model does not account for, such as those of an error in the posture.

use crate::frame::{Body, Vector};
use crate::math::Real;

/// A force at the centre of gravity and a moment about it, both over the dynamic pressure, body axes.
///
/// Joints that are recorded slightly wrong cause such a load: it grows with the dynamic pressure, like every
/// aerodynamic load, and changes slowly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct ResidualLoad<T: Real> {
    /// Force (N/Pa, m2).
    pub force: Vector<T, Body>,
    /// Moment (N m/Pa, m3).
    pub moment: Vector<T, Body>,
}

impl<T: Real> ResidualLoad<T> {
    /// The model accounts for everything.
    pub fn none() -> Self {
        Self {
            force: Vector::zero(),
            moment: Vector::zero(),
        }
    }

    /// Whether there is none.
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == Self::none()
    }

    /// The same load in another precision.
    pub fn cast<U: Real>(&self) -> ResidualLoad<U> {
        ResidualLoad {
            force: self.force.cast(),
            moment: self.moment.cast(),
        }
    }
}
