//! Delay of the measured velocity.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "gnss-latency",
    kind: Kind::Measurement,
    form: "delay of the measured velocity",
    parameters: &[parameter("latency_s", 0.0, 0.0, 0.3)],
    source: "GNSS receivers: 0.1 to 0.4 s",
    signature: "velocity that follows attitude and posture too late, while the attitude does not",
    confused_with: &["posture-delay"],
    separated_by: "changes of speed: from belly to track and back",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [latency, ..] = *values;
    model.sensors.velocity_latency += latency;
}
