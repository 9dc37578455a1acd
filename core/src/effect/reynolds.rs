//! Drag coefficients that decrease with speed, as near the drag crisis.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "reynolds",
    kind: Kind::Physics,
    form: "exponent with which the drag coefficient decreases with speed, unchanged at 50 m/s",
    parameters: &[parameter("exponent", 0.0, 0.0, 1.5)],
    source: "cylinders at Reynolds numbers of 1e5 to 5e5",
    signature: "drag that differs between slow and fast falls by the same ratio in all postures",
    confused_with: &["density-gradient", "drag"],
    separated_by: "the same posture at two fall rates",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [exponent, ..] = *values;
    model.dynamics.stream.reynolds += exponent;
}
