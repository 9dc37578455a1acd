//! A stronger or weaker effect of the arch on the drag than in the paper.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::aerodynamics::ArchFactor;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "arch",
    kind: Kind::Physics,
    form: "factor on the difference of the arch factor from one",
    parameters: &[parameter("factor", 1.0, -2.0, 5.0)],
    source: "paper eq. (arch_eq)",
    signature: "drag that depends on the bend of spine and hips",
    confused_with: &["drag"],
    separated_by: "arching and de-arching at constant attitude",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [factor, ..] = *values;
    let arch = &mut model.dynamics.aerodynamics.arch;
    *arch = match *arch {
        ArchFactor::FromPosture if factor == T::one() => ArchFactor::FromPosture,
        ArchFactor::FromPosture => ArchFactor::Scaled(factor),
        ArchFactor::Scaled(scale) => ArchFactor::Scaled(scale * factor),
        ArchFactor::Fixed(value) => ArchFactor::Fixed(value),
    };
}
