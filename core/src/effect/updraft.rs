//! Vertical wind; in a tunnel, an error of the airspeed given in the file.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "updraft",
    kind: Kind::Physics,
    form: "upward velocity of the air, in addition to the file's",
    parameters: &[parameter("up_mps", 0.0, -30.0, 30.0)],
    source: "thermals and waves reach 10 m/s; the air speed of a tunnel is rarely recorded with a flight",
    signature: "fall rate that differs by the same amount in all postures, fast or slow",
    confused_with: &["mass", "drag", "density-gradient"],
    separated_by: "fast and slow falls: head-down, then with limbs spread",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [up, ..] = *values;
    let air = &mut model.dynamics.air.velocity;
    let rising = nalgebra::Vector3::new(T::zero(), T::zero(), up);
    *air = Vector::from_components(air.components + rising);
}
