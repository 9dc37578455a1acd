//! What the skydiver puts in without meaning to: damping that differs, and a constant muscle input.

use nalgebra::Vector3;

use super::{Description, Model, PARAMETER_COUNT, Parameter};
use crate::math::Real;

const fn damping(name: &'static str) -> Parameter {
    Parameter {
        name,
        neutral: 1.0,
        low: -1.0,
        high: 4.0,
    }
}

/// Damping coefficients that differ; negative where the skydiver drives the rotation.
pub const DAMPING: Description = Description {
    name: "damping",
    form: "factor on the damping moment coefficients",
    parameters: &[
        damping("pitch_factor"),
        damping("yaw_factor"),
        damping("roll_factor"),
    ],
    source: "paper eq. (sum_m)",
    signature: "moment against or along the angular velocity, nothing at rest",
    confused_with: &["mass"],
    separated_by: "a steady turn followed by a stop",
};

const fn muscle(name: &'static str) -> Parameter {
    Parameter {
        name,
        neutral: 0.0,
        low: -1.0,
        high: 1.0,
    }
}

/// The same muscle input all along.
pub const MUSCLE: Description = Description {
    name: "muscle",
    form: "input moment coefficients added to the skydiver's",
    parameters: &[muscle("yaw"), muscle("pitch"), muscle("roll")],
    source: "paper eqs. (eq1), (eq1_1)",
    signature: "moment in body axes that follows the load on the limbs",
    confused_with: &["cg-offset", "moment"],
    separated_by: "belly and back attitudes in turn with the same limbs",
};

pub(super) fn scale_damping<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    model
        .damping_factor
        .component_mul_assign(&Vector3::from(*values));
}

pub(super) fn add_muscle<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [yaw, pitch, roll] = *values;
    model.muscle.yaw += yaw;
    model.muscle.pitch += pitch;
    model.muscle.roll += roll;
}
