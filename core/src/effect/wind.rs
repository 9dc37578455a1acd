//! Horizontal wind, the same at all heights.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "wind",
    kind: Kind::Physics,
    form: "velocity of the air, in addition to the file's",
    parameters: &[
        parameter("north_mps", 0.0, -40.0, 40.0),
        parameter("west_mps", 0.0, -40.0, 40.0),
    ],
    source: "aerodynamic forces depend on the velocity through the air",
    signature: "horizontal force in a fixed direction over ground, independent of the heading",
    confused_with: &["exit-speed", "wind-shear", "lift"],
    separated_by: "a full turn at constant posture",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [north, west, _] = *values;
    model.dynamics.air.velocity += Vector::new(north, west, T::zero());
}
