//! Stability of a steady fall: eigenvalues of the linearised step.

use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::small_rotation;
use nalgebra::{SMatrix, SVector, Vector3};
use serde::Serialize;

/// Number of states of a small motion: rotation (rad), velocity (m/s), angular velocity (rad/s).
pub const STATES: usize = 9;
/// Size of a disturbance, in the units of the states.
pub const DISTURBANCE: f64 = 1e-5;
/// Eigenvalues below this belong to the heading, which has no restoring moment (1/s).
const NEUTRAL: f64 = 1e-3;

/// The development of a small motion: `exp(growth t)`, oscillating with `frequency`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Mode {
    /// Rate of growth (1/s); negative if it decays.
    pub growth_per_s: f64,
    /// Angular frequency (rad/s); 0 if it does not oscillate.
    pub frequency_radps: f64,
}

/// Modes about `motion`, a steady fall in the posture of `sample`, the fastest growing first.
///
/// The step itself is linearised, so these are the modes of the simulation.
pub fn modes(
    dynamics: &Dynamics<f64>,
    sample: &PostureSample<f64>,
    inputs: &Inputs<f64>,
    motion: &Motion<f64>,
) -> Vec<Mode> {
    let slope = slope(dynamics, sample, inputs, motion);
    let mut modes: Vec<Mode> = slope
        .complex_eigenvalues()
        .iter()
        .map(|value| Mode {
            growth_per_s: value.norm_sqr().ln() / (2.0 * TIME_STEP),
            frequency_radps: value.im.atan2(value.re) / TIME_STEP,
        })
        .filter(|mode| mode.growth_per_s.hypot(mode.frequency_radps) > NEUTRAL)
        // Keeps one of each conjugate pair.
        .filter(|mode| mode.frequency_radps >= 0.0)
        .collect();
    modes.sort_by(|a, b| b.growth_per_s.total_cmp(&a.growth_per_s));
    modes
}

/// Derivative of the motion after a step with respect to that before it, about `motion` in the posture of `sample`.
pub fn slope(
    dynamics: &Dynamics<f64>,
    sample: &PostureSample<f64>,
    inputs: &Inputs<f64>,
    motion: &Motion<f64>,
) -> SMatrix<f64, STATES, STATES> {
    let after = |disturbance: &SVector<f64, STATES>| {
        let start = State::from_motion(&disturbed(motion, disturbance), sample);
        let next = dynamics.step(&start, sample, inputs, TIME_STEP);
        difference(motion, &next.motion(sample))
    };
    let columns: [SVector<f64, STATES>; STATES] = core::array::from_fn(|column| {
        let mut disturbance = SVector::<f64, STATES>::zeros();
        disturbance[column] = DISTURBANCE;
        (after(&disturbance) - after(&-disturbance)) / (2.0 * DISTURBANCE)
    });
    SMatrix::from_columns(&columns)
}

/// A motion that differs from `motion` by a disturbance.
pub fn disturbed(motion: &Motion<f64>, by: &SVector<f64, STATES>) -> Motion<f64> {
    let part = |from: usize| Vector3::new(by[from], by[from + 1], by[from + 2]);
    let turned = motion.inertial_from_body.quaternion() * small_rotation(&part(0));
    let attitude = Rotation::from_quaternion(turned);
    let velocity = motion.velocity_inertial() + Vector::from_components(part(3));
    Motion {
        inertial_from_body: attitude,
        velocity: attitude.inverse() * velocity,
        angular_velocity: motion.angular_velocity + Vector::from_components(part(6)),
        ..*motion
    }
}

/// The disturbance that makes `to` of `from`.
pub fn difference(from: &Motion<f64>, to: &Motion<f64>) -> SVector<f64, STATES> {
    let turn = (from.inertial_from_body.quaternion().inverse()
        * to.inertial_from_body.quaternion())
    .scaled_axis();
    let velocity = to.velocity_inertial() - from.velocity_inertial();
    let spin = to.angular_velocity - from.angular_velocity;
    let parts = [turn, velocity.components, spin.components];
    SVector::from_iterator(parts.iter().flat_map(|part| part.iter().copied()))
}
