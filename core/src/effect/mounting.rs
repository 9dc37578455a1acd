//! Misalignment of the sensor on the pelvis.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "mounting",
    kind: Kind::Measurement,
    form: "rotation of the measured body axes about X, Y, Z",
    parameters: &[
        parameter("x_rad", 0.0, -0.5, 0.5),
        parameter("y_rad", 0.0, -0.5, 0.5),
        parameter("z_rad", 0.0, -0.5, 0.5),
    ],
    source: "sensors slip on the harness by a few degrees",
    signature: "attitude and angular velocity rotated equally, in body axes",
    confused_with: &["cg-offset", "muscle"],
    separated_by: "alternating belly and back attitudes",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    model.sensors.mounting += nalgebra::Vector3::from(*values);
}
