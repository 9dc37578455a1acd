//! A constant muscle input during the whole flight.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "muscle",
    kind: Kind::Physics,
    form: "moment coefficients added to the skydiver's muscle input",
    parameters: &[
        parameter("pitch", 0.0, -1.0, 1.0),
        parameter("yaw", 0.0, -1.0, 1.0),
        parameter("roll", 0.0, -1.0, 1.0),
    ],
    source: "paper eqs. (eq1), (eq1_1)",
    signature: "moment in body axes that follows the load on the limbs",
    confused_with: &["cg-offset", "moment"],
    separated_by: "alternating belly and back attitudes in the same posture",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let input = &mut model.muscle;
    *input = input.zip_map((*values).into(), |before, value| before + value);
}
