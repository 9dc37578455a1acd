//! The velocity profile of a wind tunnel: faster on the axis.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "tunnel-profile",
    kind: Kind::Physics,
    form: "relative loss of flow speed per squared distance from the axis through the origin",
    parameters: &[parameter("per_m2", 0.0, -0.1, 0.1)],
    source: "turbulent pipe flow; measured profiles of vertical tunnels",
    signature: "a force towards the rim or the axis that grows with the distance from it; no effect in free fall",
    confused_with: &["wind"],
    separated_by: "a slow drift from the axis to the wall",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [loss, ..] = *values;
    model.dynamics.air.profile += loss;
}
