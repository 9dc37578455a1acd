//! A weight belt, or another mass at the hips.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::body::gear::carry_at_hips;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "weight-belt",
    kind: Kind::Physics,
    form: "a mass at the position of a belt in the equipment tables",
    parameters: &[parameter("mass_kg", 0.0, 0.0, 12.0)],
    source: "belts of 2 to 10 kg in relative work",
    signature: "faster fall in every posture, hips low",
    confused_with: &["mass", "cg-offset"],
    separated_by: "postures of different drag, with changes of pitch",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [mass, ..] = *values;
    if mass != T::zero() {
        carry_at_hips(&mut model.dynamics.body.segments[Segment::Pelvis], mass);
    }
}
