//! Delay of the postures relative to the inertial data.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "posture-delay",
    kind: Kind::Measurement,
    form: "delay of the recorded postures",
    parameters: &[parameter("delay_s", 0.0, -0.3, 0.3)],
    source: "wireless suits and post-processing filters",
    signature: "every response seems to precede its cause",
    confused_with: &["rate-lag"],
    separated_by: "quick changes of posture",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [delay, ..] = *values;
    model.sensors.posture_delay += delay;
}
