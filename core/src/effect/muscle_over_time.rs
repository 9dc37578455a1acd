//! Muscle input that changes at random during a flight.

use super::random::together;
use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "muscle-over-time",
    kind: Kind::Random,
    form: "input moment coefficients that change at random about the skydiver's, their standard deviations; correlation \
           time 2 s",
    parameters: &[
        parameter("pitch_deviation", 0.0, 0.0, 1.0),
        parameter("yaw_deviation", 0.0, 0.0, 1.0),
        parameter("roll_deviation", 0.0, 0.0, 1.0),
    ],
    source: "paper eq. (ukf_state): a random walk of each input; skydivers correct at 0.2 to 1 Hz",
    signature: "moments in body axes that follow the load on the limbs, with a mean of zero over some seconds",
    confused_with: &["muscle", "damping-over-time", "turbulence"],
    separated_by: "the same movements twice: the muscle input differs between them",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    model.random.muscle = together(model.random.muscle, (*values).into());
}
