//! Changes in one window, a tenth of a second of a stretch: deviations of air and inputs from the model's, and pushes.

use bodyflight_core::axis::AxisCoefficients;
use bodyflight_core::dynamics::{Dynamics, Inputs, PostureSample, State};
use bodyflight_core::effect::Effect;
use bodyflight_core::frame::Vector;
use nalgebra::Vector3;

/// Steps of the finite differences: velocity of the air (m/s), input coefficients, fractions of the damping.
const AIR_STEP: f64 = 1.0;
const MUSCLE_STEP: f64 = 0.1;
const DAMPING_STEP: f64 = 0.2;

/// Deviations of air and inputs from the model's in one window of a stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct InputPerturbation {
    window: usize,
    /// Velocity of the air (m/s), inertial axes.
    air: Vector3<f64>,
    /// Muscle input, and deviation of the damping as a fraction: pitch, yaw, roll.
    muscle: Vector3<f64>,
    damping: Vector3<f64>,
}

impl InputPerturbation {
    /// A small change that an effect causes in a window about an axis, and its size.
    pub(crate) fn new(effect: Effect, window: usize, axis: usize) -> (Self, f64) {
        let mut varied = Self {
            window,
            air: Vector3::zeros(),
            muscle: Vector3::zeros(),
            damping: Vector3::zeros(),
        };
        let (of, size) = match effect {
            Effect::MuscleOverTime => (&mut varied.muscle, MUSCLE_STEP),
            Effect::DampingOverTime => (&mut varied.damping, DAMPING_STEP),
            _ => (&mut varied.air, AIR_STEP),
        };
        of[axis] = size;
        (varied, size)
    }

    /// The air and the inputs in a window.
    pub(crate) fn applied(
        &self,
        window: usize,
        dynamics: &Dynamics<f64>,
        inputs: &Inputs<f64>,
    ) -> (Dynamics<f64>, Inputs<f64>) {
        let (mut dynamics, mut inputs) = (*dynamics, *inputs);
        if window == self.window {
            dynamics.air.velocity += Vector::from_components(self.air);
            let of = |vector: &Vector3<f64>| AxisCoefficients::from(<[f64; 3]>::from(*vector));
            inputs.muscle = inputs
                .muscle
                .zip_map(of(&self.muscle), |own, more| own + more);
            inputs.damping = inputs
                .damping
                .zip_map(of(&self.damping), |own, share| own * (1.0 + share));
        }
        (dynamics, inputs)
    }
}

/// A force and a moment acting during one window of a stretch (body axes).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct UnknownWrench {
    /// Index of the window.
    pub window: usize,
    /// Force (N).
    pub force: Vector3<f64>,
    /// Moment (N m).
    pub moment: Vector3<f64>,
}

impl UnknownWrench {
    /// Adds its effect on the motion over `duration` (s).
    pub(crate) fn act_on(
        &self,
        state: &mut State<f64>,
        sample: &PostureSample<f64>,
        duration: f64,
    ) {
        let inertial = |body: Vector3<f64>| {
            (state.inertial_from_body * Vector::from_components(body * duration)).components
        };
        let (force, moment) = (inertial(self.force), inertial(self.moment));
        state.linear_momentum.components += force;
        state.angular_momentum.components += moment;
        state.cg_position.components += force * (0.5 * duration / sample.mass.mass);
    }
}
