//! Delay of the measured angular velocity by a low-pass filter.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "rate-lag",
    kind: Kind::Measurement,
    form: "delay of the angular velocity's filter",
    parameters: &[parameter("lag_s", 0.0, 0.0, 0.2)],
    source: "filters of IMUs at 5 to 50 Hz",
    signature: "angular velocity that lags behind the attitude",
    confused_with: &["posture-delay", "gyro-bias"],
    separated_by: "quick starts and stops of turns",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [lag, ..] = *values;
    model.sensors.rate_lag += lag;
}
