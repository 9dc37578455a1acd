//! Errors of the moment coefficients of segment groups.

use super::scale_group;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "moment",
    kind: Kind::Physics,
    form: "factor on the moment coefficients of a group of segments",
    parameters: &[
        parameter("trunk_factor", 1.0, 0.3, 2.5),
        parameter("arms_factor", 1.0, 0.3, 2.5),
        parameter("legs_factor", 1.0, 0.3, 2.5),
    ],
    source: "paper eqs. (limbm), (cm)",
    signature: "moment without a force, growing with the square of the speed",
    confused_with: &["cg-offset", "muscle"],
    separated_by: "the same postures at two fall rates",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_group(values, model, |coefficients| &mut coefficients.moment);
}
