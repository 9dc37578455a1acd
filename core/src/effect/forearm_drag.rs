//! Drag of forearms and hands, left and right separately.

use super::scale_sides;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "forearm-drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of forearms and hands",
    parameters: &[
        parameter("left_factor", 1.0, 0.3, 3.0),
        parameter("right_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf); sleeves, gloves, altimeters, an injured arm",
    signature: "force along the stream with a long lever arm, with a yaw and roll moment if the sides differ",
    confused_with: &["drag", "upper-arm-drag", "muscle"],
    separated_by: "elbows bent and stretched, one side after the other",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_sides(
        values,
        model,
        [
            &[Segment::LeftForearm, Segment::LeftHand],
            &[Segment::RightForearm, Segment::RightHand],
        ],
    );
}
