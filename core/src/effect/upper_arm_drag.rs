//! Drag of the upper arms, left and right separately.

use super::scale_sides;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "upper-arm-drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of the upper arms",
    parameters: &[
        parameter("left_factor", 1.0, 0.3, 3.0),
        parameter("right_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf); sleeves and wings of suits",
    signature: "force along the stream at the shoulders, with a roll and yaw moment if the sides differ",
    confused_with: &["drag", "forearm-drag"],
    separated_by: "upper arms spread and closed, elbows bent",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_sides(
        values,
        model,
        [&[Segment::LeftUpperArm], &[Segment::RightUpperArm]],
    );
}
