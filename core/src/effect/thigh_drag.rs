//! Drag of the thighs, left and right separately.

use super::scale_sides;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "thigh-drag",
    kind: Kind::Physics,
    form: "factor on the drag coefficients of the thighs",
    parameters: &[
        parameter("left_factor", 1.0, 0.3, 3.0),
        parameter("right_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf); pockets, leg straps, loose cloth",
    signature: "force along the stream close to the hips, with a roll moment if the sides differ",
    confused_with: &["drag", "shank-drag", "mass"],
    separated_by: "hips bent and stretched with constant knees",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    scale_sides(
        values,
        model,
        [&[Segment::LeftThigh], &[Segment::RightThigh]],
    );
}
