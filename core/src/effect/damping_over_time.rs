//! Damping that changes at random during a flight.

use super::random::together;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "damping-over-time",
    kind: Kind::Random,
    form: "factors on the damping moment coefficients that change at random about one, their standard deviations; \
           correlation time 2 s",
    // The largest strength at which the damping stays positive.
    parameters: &[
        parameter("pitch_deviation", 0.0, 0.0, 0.7),
        parameter("yaw_deviation", 0.0, 0.0, 0.7),
        parameter("roll_deviation", 0.0, 0.0, 0.7),
    ],
    source: "paper eq. (ukf_state): a random walk of each damping coefficient",
    signature: "moments against or along the angular velocity that come and go, zero at rest",
    confused_with: &["damping", "muscle-over-time"],
    separated_by: "turns of one speed held for ten seconds",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    model.random.damping = together(model.random.damping, (*values).into());
}
