//! Size of the rig: area and drag of the thorax.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "rig-size",
    kind: Kind::Physics,
    form: "factors on the areas and the drag coefficient of the thorax",
    parameters: &[
        parameter("area_factor", 1.0, 0.3, 3.0),
        parameter("drag_factor", 1.0, 0.3, 3.0),
    ],
    source: "a container on the back adds a third to a half of the thorax's area",
    signature: "slower fall, and a moment proportional to the drag of the chest, in every posture",
    confused_with: &["drag", "trunk-shape", "mass"],
    separated_by: "alternating belly and back attitudes, then head-down",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [area, drag, _] = *values;
    model.dynamics.body.segments[Segment::Thorax].area *= area;
    model.dynamics.aerodynamics.coefficients[Segment::Thorax].drag *= drag;
}
