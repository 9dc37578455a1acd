//! Air density that changes with altitude.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::air::Density;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "density-gradient",
    kind: Kind::Physics,
    form: "relative decrease of the air density per kilometre above the starting height of the flight",
    parameters: &[parameter("per_km", 0.0, -0.3, 0.3)],
    source: "U.S. Standard Atmosphere 1976: 0.09 to 0.10 per km below 5 km",
    signature: "fall rate that drifts with height, equally in every posture",
    confused_with: &["reynolds"],
    separated_by: "the same posture at the beginning and at the end of a long fall",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [per_kilometre, ..] = *values;
    let air = &mut model.dynamics.air;
    let height = model.start_height;
    if per_kilometre != T::zero() {
        air.density = Density::Linear {
            density: air.density.at(height),
            height,
            slope: per_kilometre * T::of(-1e-3),
        };
    }
}
