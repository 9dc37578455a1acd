//! Turbulence: velocity of the air that changes at random.

use super::random::Turbulence;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "turbulence",
    kind: Kind::Random,
    form: "random velocity of the air with the spectrum of Dryden, frozen while the body falls through it: the standard \
           deviation of its change along 30 m of the path, and its length scale",
    parameters: &[
        parameter("gust_mps", 0.0, 0.0, 3.0),
        parameter("length_m", 150.0, 20.0, 1000.0),
    ],
    source: "MIL-F-8785C: standard deviations of 1.5 m/s (light), 3 (moderate) and 6 (severe); lengths from 50 m near the \
             ground to 500 m above 600 m",
    signature: "forces along all axes over ground that come and go within seconds, stronger on a body that falls faster",
    confused_with: &["wind", "updraft", "muscle-over-time", "wind-shear"],
    separated_by: "two flights in the same air with the same movements: turbulence differs between them",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [gust, length, _] = *values;
    if gust > T::zero() {
        model.random.turbulence = Turbulence::from_gusts(gust, length);
    }
}
