//! Loads that the model does not account for, such as those caused by errors in the recorded posture.

use crate::frame::{Body, Vector};
use crate::math::{Lanes, Real};

/// A force at the centre of gravity and a moment about it, both divided by the dynamic pressure, in body axes.
///
/// Small errors of the recorded joints cause such a load: it is proportional to the dynamic pressure, like every
/// aerodynamic load, and changes slowly.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct ResidualLoad<T: Lanes> {
    /// Force divided by the dynamic pressure (N/Pa = m2).
    pub force: Vector<T, Body>,
    /// Moment divided by the dynamic pressure (N m/Pa = m3).
    pub moment: Vector<T, Body>,
}

impl<T: Lanes> ResidualLoad<T> {
    /// No residual load.
    pub fn none() -> Self {
        Self {
            force: Vector::zero(),
            moment: Vector::zero(),
        }
    }

    /// Returns whether the residual load is zero.
    #[inline]
    pub fn is_none(&self) -> bool {
        *self == Self::none()
    }

    /// Converts the load to another precision.
    pub fn cast<U: Lanes>(&self) -> ResidualLoad<U>
    where
        T: Real,
    {
        ResidualLoad {
            force: self.force.cast(),
            moment: self.moment.cast(),
        }
    }
}
