//! Vertical wind; in a tunnel, an error of the airspeed given in the file.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "updraft",
    kind: Kind::Physics,
    form: "vertical velocity added to that of the air, up",
    parameters: &[parameter("up_mps", 0.0, -30.0, 30.0)],
    source: "thermals and waves reach 10 m/s; the speed of a tunnel is seldom recorded with a flight",
    signature: "speed of the fall off by the same amount in all postures, fast or slow",
    confused_with: &["mass", "drag", "density-gradient"],
    separated_by: "the same flight fast and slow: head-down, then spread",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [up, ..] = *values;
    let air = &mut model.dynamics.air.velocity;
    let rising = nalgebra::Vector3::new(T::zero(), T::zero(), up);
    *air = Vector::from_components(air.components + rising);
}
