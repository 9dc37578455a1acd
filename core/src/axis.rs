//! A set of coefficients, one for each axis of the body.

use nalgebra::Vector3;

use crate::math::{Lanes, Real};

/// One coefficient for each axis of the body, in the order X, Y, Z.
///
/// All sequences of such coefficients (states, tables, columns of files, messages) use this order: pitch, yaw, roll.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct AxisCoefficients<T> {
    /// About the left axis X.
    pub pitch: T,
    /// About the dorsal axis Y.
    pub yaw: T,
    /// About the cranial axis Z.
    pub roll: T,
}

/// Names of the axes in the order of [`AxisCoefficients`].
pub const AXIS_NAMES: [&str; 3] = ["pitch", "yaw", "roll"];

impl<T> AxisCoefficients<T> {
    /// Creates a set from the coefficients about X, Y and Z.
    pub const fn new(pitch: T, yaw: T, roll: T) -> Self {
        Self { pitch, yaw, roll }
    }

    /// Returns the coefficients about X, Y and Z.
    pub fn to_array(self) -> [T; 3] {
        [self.pitch, self.yaw, self.roll]
    }

    /// Applies `change` to each coefficient.
    pub fn map<U>(self, change: impl FnMut(T) -> U) -> AxisCoefficients<U> {
        self.to_array().map(change).into()
    }

    /// Combines two sets with `join`, axis by axis.
    pub fn zip_map<U, V>(
        self,
        other: AxisCoefficients<U>,
        mut join: impl FnMut(T, U) -> V,
    ) -> AxisCoefficients<V> {
        AxisCoefficients {
            pitch: join(self.pitch, other.pitch),
            yaw: join(self.yaw, other.yaw),
            roll: join(self.roll, other.roll),
        }
    }
}

impl<T: Lanes> AxisCoefficients<T> {
    /// Returns zero about every axis: relaxed, or undamped.
    pub fn zero() -> Self {
        Self::repeat(T::zero())
    }

    /// Returns the same coefficient about every axis.
    pub fn repeat(value: T) -> Self {
        Self::new(value, value, value)
    }

    /// Returns whether every coefficient is zero.
    pub fn is_zero(&self) -> bool {
        *self == Self::zero()
    }

    /// Returns the coefficients as components along X, Y and Z of the body frame.
    pub fn to_vector(self) -> Vector3<T> {
        self.to_array().into()
    }

    /// Converts the coefficients to another precision.
    pub fn cast<U: Lanes>(self) -> AxisCoefficients<U>
    where
        T: Real,
    {
        self.map(|value| U::of(value.to_f64()))
    }
}

impl<T> From<[T; 3]> for AxisCoefficients<T> {
    /// Creates a set from pitch, yaw and roll.
    fn from([pitch, yaw, roll]: [T; 3]) -> Self {
        Self { pitch, yaw, roll }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_the_body_axes() {
        let coefficients = AxisCoefficients {
            yaw: 2.0,
            roll: 3.0,
            pitch: 1.0,
        };
        assert_eq!(coefficients.to_vector(), Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(AxisCoefficients::from([1.0, 2.0, 3.0]), coefficients);
        assert_eq!(AXIS_NAMES, ["pitch", "yaw", "roll"]);
    }
}
