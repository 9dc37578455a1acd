//! A displaced centre of gravity of the trunk.

use super::is_trunk;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "cg-offset",
    kind: Kind::Physics,
    form: "shift of the centres of gravity of pelvis, abdomen and thorax, body axes",
    parameters: &[
        parameter("left_m", 0.0, -0.1, 0.1),
        parameter("dorsal_m", 0.0, -0.1, 0.1),
        parameter("cranial_m", 0.0, -0.1, 0.1),
    ],
    source: "rigid-body mechanics; represents unevenly placed equipment",
    signature: "moment proportional to the aerodynamic force, zero if that force is parallel to the shift",
    confused_with: &["muscle", "moment"],
    separated_by: "belly, back and side attitudes one after another",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    for (segment, parameters) in model.dynamics.body.segments.iter_mut() {
        if is_trunk(segment) {
            parameters.cg += nalgebra::Vector3::from(*values);
        }
    }
}
