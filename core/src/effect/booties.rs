//! Booties: more area on shanks and feet.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "booties",
    kind: Kind::Physics,
    form: "factor on the areas of shanks and feet",
    parameters: &[parameter("factor", 1.0, 0.3, 3.0)],
    source: "tracking and relative-work suits; feet with booties have about twice the area",
    signature: "moment that lifts the legs, proportional to the dynamic pressure",
    confused_with: &["drag", "moment", "arch"],
    separated_by: "alternately stretched and bent legs",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [factor, ..] = *values;
    for (segment, parameters) in model.dynamics.body.segments.iter_mut() {
        let lower = matches!(
            segment,
            Segment::LeftShank | Segment::RightShank | Segment::LeftFoot | Segment::RightFoot
        );
        if lower {
            parameters.area *= factor;
        }
    }
}
