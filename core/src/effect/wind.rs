//! Horizontal wind, the same at all heights.

use super::{Description, Model, PARAMETER_COUNT, Parameter};
use crate::frame::Vector;
use crate::math::Real;

const fn speed(name: &'static str) -> Parameter {
    Parameter {
        name,
        neutral: 0.0,
        low: -40.0,
        high: 40.0,
    }
}

/// Wind.
pub const WIND: Description = Description {
    name: "wind",
    form: "velocity added to that of the air",
    parameters: &[speed("north_mps"), speed("west_mps")],
    source: "model.md: forces depend on the velocity through the air",
    signature: "horizontal force along one direction over ground, whatever the heading",
    confused_with: &["lift"],
    separated_by: "a full turn at constant posture",
};

pub(super) fn blow<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [north, west, _] = *values;
    let air = &mut model.dynamics.air.velocity;
    *air = Vector::from_components(air.components + nalgebra::Vector3::new(north, west, T::zero()));
}
