//! Limbs in the wake of the trunk.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "shelter",
    kind: Kind::Physics,
    form: "fraction of the load that a segment far behind the trunk loses, half of it at 0.1 m behind the middle",
    parameters: &[parameter("share", 0.0, 0.0, 1.0)],
    source: "bluff bodies in tandem: the load of the second is a half to a fifth",
    signature: "less load on limbs behind the trunk: head-down and standing falls are faster",
    confused_with: &["drag"],
    separated_by: "belly, sit and head-down one after another",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [share, ..] = *values;
    model.dynamics.stream.shelter += share;
}
