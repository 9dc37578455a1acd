//! A constant error of the measured angular velocity.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "gyro-bias",
    kind: Kind::Measurement,
    form: "angular velocity added to the measurement, body axes",
    parameters: &[
        parameter("x_radps", 0.0, -0.5, 0.5),
        parameter("y_radps", 0.0, -0.5, 0.5),
        parameter("z_radps", 0.0, -0.5, 0.5),
    ],
    source: "MEMS gyroscopes: 0.2 to 3 deg/s before calibration",
    signature: "angular velocity that is inconsistent with the attitude",
    confused_with: &["damping"],
    separated_by: "any maneuver: attitude and angular velocity are both measured",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    model.sensors.gyro_bias += (*values).into();
}
