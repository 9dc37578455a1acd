//! The person's mass, and where the trunk carries it.

use nalgebra::Vector3;

use super::{Description, Model, PARAMETER_COUNT, Parameter, is_trunk};
use crate::math::Real;

/// A wrong mass, spread as the body's.
pub const MASS: Description = Description {
    name: "mass",
    form: "factor on masses and inertias of all segments",
    parameters: &[Parameter {
        name: "factor",
        neutral: 1.0,
        low: 0.7,
        high: 1.5,
    }],
    source: "rigid-body mechanics; shape and areas are kept",
    signature: "fall rate off by the root of the factor, slower response to every moment",
    confused_with: &["drag"],
    separated_by: "postures of different drag, with changes of speed in between",
};

const fn shift_along(name: &'static str) -> Parameter {
    Parameter {
        name,
        neutral: 0.0,
        low: -0.1,
        high: 0.1,
    }
}

/// Centre of gravity of the trunk off its place.
pub const CG_OFFSET: Description = Description {
    name: "cg-offset",
    form: "shift of the centres of gravity of pelvis, abdomen and thorax, body axes",
    parameters: &[
        shift_along("left_m"),
        shift_along("dorsal_m"),
        shift_along("cranial_m"),
    ],
    source: "rigid-body mechanics; stands for uneven equipment",
    signature: "moment that goes with the force of the air, zero where its line meets the shift",
    confused_with: &["muscle", "moment"],
    separated_by: "belly, back and side attitudes in turn",
};

pub(super) fn scale<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [factor, ..] = *values;
    for (_, segment) in model.dynamics.body.segments.iter_mut() {
        segment.mass *= factor;
        segment.inertia *= factor;
    }
}

pub(super) fn shift<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    for (segment, parameters) in model.dynamics.body.segments.iter_mut() {
        if is_trunk(segment) {
            parameters.cg += Vector3::from(*values);
        }
    }
}
