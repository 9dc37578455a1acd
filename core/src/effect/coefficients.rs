//! Aerodynamic coefficients of segment groups that are off.

use super::{Description, Model, PARAMETER_COUNT, Parameter, is_trunk};
use crate::aerodynamics::Coefficients;
use crate::body::Segment;
use crate::math::Real;

const fn factor(name: &'static str) -> Parameter {
    Parameter {
        name,
        neutral: 1.0,
        low: 0.3,
        high: 2.5,
    }
}

/// Trunk with head, arms with hands, legs with feet.
const GROUPS: &[Parameter] = &[
    factor("trunk_factor"),
    factor("arms_factor"),
    factor("legs_factor"),
];

/// Drag coefficients.
pub const DRAG: Description = Description {
    name: "drag",
    form: "factor on the drag coefficients of a group of segments",
    parameters: GROUPS,
    source: "paper eq. (limbf)",
    signature: "force along the stream; off the trunk also a moment, with the lever of the group",
    confused_with: &["mass", "lift"],
    separated_by: "arms and legs spread and closed in turn",
};

/// Lift coefficients.
pub const LIFT: Description = Description {
    name: "lift",
    form: "factor on the coefficients of the force across the stream of a group of segments",
    parameters: GROUPS,
    source: "paper eqs. (limbf), (coeffCl)",
    signature: "force across the stream that vanishes where segments lie along or square to it",
    confused_with: &["wind", "drag"],
    separated_by: "tracking, then a turn",
};

/// Moment coefficients.
pub const MOMENT: Description = Description {
    name: "moment",
    form: "factor on the moment coefficients of a group of segments",
    parameters: GROUPS,
    source: "paper eqs. (limbm), (cm)",
    signature: "moment without a force, growing with the square of the speed",
    confused_with: &["cg-offset", "muscle"],
    separated_by: "the same postures at two speeds of fall",
};

pub(super) fn scale<T: Real>(
    values: &[T; PARAMETER_COUNT],
    model: &mut Model<T>,
    coefficient: impl Fn(&mut Coefficients<T>) -> &mut T,
) {
    let [trunk, arms, legs] = *values;
    for (segment, coefficients) in model.dynamics.aerodynamics.coefficients.iter_mut() {
        let factor = match segment {
            Segment::Head => trunk,
            _ if is_trunk(segment) => trunk,
            Segment::LeftUpperArm
            | Segment::LeftForearm
            | Segment::LeftHand
            | Segment::RightUpperArm
            | Segment::RightForearm
            | Segment::RightHand => arms,
            _ => legs,
        };
        *coefficient(coefficients) *= factor;
    }
}
