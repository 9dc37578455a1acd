//! Drag of the feet, left and right separately.

use super::scale_sides;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "foot-drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of the feet",
    parameters: &[
        parameter("left_factor", 1.0, 0.3, 3.0),
        parameter("right_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf); booties, shoes",
    signature: "moment that lifts the legs and depends on the angle of the feet",
    confused_with: &["drag", "booties", "shank-drag"],
    separated_by: "feet pointed and flexed",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_sides(values, model, [&[Segment::LeftFoot], &[Segment::RightFoot]]);
}
