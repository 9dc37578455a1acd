//! Errors of the lift coefficients of segment groups, which scale the force across the airstream.

use super::scale_group;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "lift",
    kind: Kind::Physics,
    form: "factor on the lift coefficients of a group of segments",
    parameters: &[
        parameter("trunk_factor", 1.0, 0.3, 2.5),
        parameter("arms_factor", 1.0, 0.3, 2.5),
        parameter("legs_factor", 1.0, 0.3, 2.5),
    ],
    source: "paper eqs. (limbf), (coeffCl)",
    signature: "force across the stream that vanishes for segments along or normal to it",
    confused_with: &["wind", "drag"],
    separated_by: "tracking, then a turn",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_group(values, model, |coefficients| &mut coefficients.lift);
}
