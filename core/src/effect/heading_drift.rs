//! Drift of the measured heading.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "heading-drift",
    kind: Kind::Measurement,
    form: "rate of the heading error",
    parameters: &[parameter("rad_s", 0.0, -0.1, 0.1)],
    source: "magnetic disturbance; inertial heading without a magnetometer",
    signature: "heading that changes contrary to the angular velocity",
    confused_with: &["gyro-bias"],
    separated_by: "any maneuver: attitude and angular velocity are both measured",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [rate, ..] = *values;
    model.sensors.heading_drift += rate;
}
