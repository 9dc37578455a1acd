//! Drag of the shanks, left and right separately.

use super::scale_sides;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "shank-drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of the shanks",
    parameters: &[
        parameter("left_factor", 1.0, 0.3, 3.0),
        parameter("right_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf); suit legs",
    signature: "moment that lifts the legs and depends on the bend of the knees, with a yaw moment if the sides differ",
    confused_with: &["drag", "booties", "foot-drag"],
    separated_by: "knees bent and stretched, one side after the other",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_sides(
        values,
        model,
        [&[Segment::LeftShank], &[Segment::RightShank]],
    );
}
