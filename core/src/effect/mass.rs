//! An error of the mass: one factor on the masses and inertias of all segments.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "mass",
    kind: Kind::Physics,
    form: "factor on masses and inertias of all segments",
    parameters: &[parameter("factor", 1.0, 0.6, 1.7)],
    source: "rigid-body mechanics; shape and areas are unchanged",
    signature: "fall rate that differs by the square root of the factor, and a slower response to every moment",
    confused_with: &["drag", "added-mass"],
    separated_by: "postures of different drag, with changes of speed in between",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [factor, ..] = *values;
    model.dynamics.body.scale_mass(factor);
}
