//! Added mass: air that accelerates with the body.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "added-mass",
    kind: Kind::Physics,
    form: "inertia without weight, as a fraction of the body's",
    parameters: &[parameter("share", 0.0, 0.0, 0.5)],
    source: "potential flow: the mass of the displaced air, about 0.1 kg, more in separated flow",
    signature: "slower response to every force, at the same terminal speed",
    confused_with: &["mass", "damping"],
    separated_by: "quick changes of posture, and a steady fall",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [share, ..] = *values;
    let factor = T::one() + share;
    for (_, segment) in model.dynamics.body.segments.iter_mut() {
        segment.mass *= factor;
        segment.inertia *= factor;
    }
    model.dynamics.gravity /= factor;
}
