//! Horizontal wind that changes with height.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::air::Shear;
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "wind-shear",
    kind: Kind::Physics,
    form: "velocity added to that of the air for each kilometre up, from the height at which the flight starts",
    parameters: &[
        parameter("north_mps_per_km", 0.0, -30.0, 30.0),
        parameter("west_mps_per_km", 0.0, -30.0, 30.0),
    ],
    source: "winds aloft: 2 to 10 m/s for each kilometre, more at an inversion",
    signature: "horizontal force along one direction over ground that grows as the fall goes on",
    confused_with: &["wind", "heading-drift"],
    separated_by: "a fall of a kilometre or more with full turns at its beginning and at its end",
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
