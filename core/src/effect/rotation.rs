//! Local flow from rotation: outlying segments of a rotating body meet a different airstream.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "local-flow",
    kind: Kind::Physics,
    form: "fraction of the velocity from body rotation, angular velocity x r, that acts on segments",
    parameters: &[parameter("share", 0.0, 0.0, 2.0)],
    source: "rigid-body kinematics; the paper includes it in the damping",
    signature: "moment against every rotation that grows with speed and with spread limbs",
    confused_with: &["damping"],
    separated_by: "turns with arms spread and closed",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [share, ..] = *values;
    model.dynamics.stream.rotation += share;
}
