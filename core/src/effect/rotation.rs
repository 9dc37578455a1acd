//! Local flow from rotation: outlying segments of a rotating body meet a different airstream.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "local-flow",
    kind: Kind::Physics,
    form: "share of the velocity spin x r that segments feel",
    parameters: &[parameter("share", 0.0, 0.0, 2.0)],
    source: "rigid-body kinematics; the paper lumps it into the damping",
    signature: "moment against every rotation, which grows with the speed and with limbs spread",
    confused_with: &["damping"],
    separated_by: "turns with arms spread and closed",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [share, ..] = *values;
    model.dynamics.stream.rotation += share;
}
