//! Speed of the aircraft at exit, which is missing in recordings whose velocity starts from zero.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::frame::Vector;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "exit-speed",
    kind: Kind::Measurement,
    form: "velocity missing from the measurement, north and west",
    parameters: &[
        parameter("north_mps", 0.0, -60.0, 60.0),
        parameter("west_mps", 0.0, -60.0, 60.0),
    ],
    source: "inertial recordings that start in the aircraft",
    signature: "horizontal force as from a wind, and a horizontal speed that lacks this velocity",
    confused_with: &["wind"],
    separated_by: "nothing without satellites: in the recording it looks like a wind",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [north, west, _] = *values;
    model.sensors.velocity_offset -= Vector::new(north, west, T::zero());
}
