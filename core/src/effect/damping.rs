//! Damping that differs from the model's; it may be negative.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "damping",
    kind: Kind::Physics,
    form: "factor on the damping moment coefficients",
    parameters: &[
        parameter("pitch_factor", 1.0, -0.1, 4.0),
        parameter("yaw_factor", 1.0, -0.1, 4.0),
        // Roll has the smallest inertia: with negative damping it diverges within seconds.
        parameter("roll_factor", 1.0, 0.0, 4.0),
    ],
    source: "paper eq. (sum_m)",
    signature: "moment against or along the angular velocity, zero at rest",
    confused_with: &["local-flow", "mass"],
    separated_by: "a steady turn followed by a stop",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let factor = &mut model.damping_factor;
    *factor = factor.zip_map((*values).into(), |before, value| before * value);
}
