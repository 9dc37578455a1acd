//! Horizontal wind that changes with height.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::air::Shear;
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "wind-shear",
    kind: Kind::Physics,
    form: "velocity of the air per kilometre above the starting height of the flight",
    parameters: &[
        parameter("north_mps_per_km", 0.0, -30.0, 30.0),
        parameter("west_mps_per_km", 0.0, -30.0, 30.0),
    ],
    source: "winds aloft: 2 to 10 m/s per kilometre, more at an inversion",
    signature: "horizontal force in a fixed direction over ground that grows during the fall",
    confused_with: &["wind", "heading-drift"],
    separated_by: "a fall of at least a kilometre with full turns at the beginning and at the end",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [north, west, _] = *values;
    let per_metre = Vector::new(north, west, T::zero()) * T::of(1e-3);
    if per_metre != Vector::zero() {
        model.dynamics.air.shear = Some(Shear {
            per_metre,
            height: model.start_height,
        });
    }
}
