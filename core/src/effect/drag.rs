//! Errors of the drag coefficients of segment groups.

use super::scale_group;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of a group of segments",
    parameters: &[
        parameter("trunk_factor", 1.0, 0.3, 2.5),
        parameter("arms_factor", 1.0, 0.3, 2.5),
        parameter("legs_factor", 1.0, 0.3, 2.5),
    ],
    source: "paper eq. (limbf)",
    signature: "force along the stream, and for arms and legs also a moment with their lever arm",
    confused_with: &["mass", "booties"],
    separated_by: "arms and legs alternately spread and closed",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_group(values, model, |coefficients| &mut coefficients.drag);
}
