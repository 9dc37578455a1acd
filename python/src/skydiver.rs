//! One skydiver of many: movement patterns in, a motion out, at the least cost.
//!
//! An action is one interval of the model: the geometry of its middle and constant joint rates serve all steps in it, and the
//! motion that is seen after it. That is the flight of [`bodyflight_viewer::cockpit::Cockpit`], which builds the geometry for every
//! step, to what `tests/test_gym.py` allows.

use bodyflight_core::Posture;
use bodyflight_core::body::pattern;
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::math::Real;
use bodyflight_viewer::cockpit::{CONTROLS, Control, Start};
use bodyflight_viewer::setup::Setup;
use nalgebra::{Quaternion, UnitQuaternion};

/// Share of a control's range that a joint moves in a second, as in the page.
const SPEED: f32 = 3.0;
/// Height at which flights begin (m).
const START_HEIGHT: f32 = 4000.0;

/// What all flights share.
pub(crate) struct Course {
    dynamics: Dynamics<f32>,
    inputs: Inputs<f32>,
    base: Posture<f32>,
    /// A flight that begins.
    begun: Skydiver,
    /// Steps of an action.
    substeps: u32,
}

/// A flight in progress.
#[derive(Clone, Copy)]
pub(crate) struct Skydiver {
    state: State<f32>,
    posture: Posture<f32>,
    amounts: [f32; CONTROLS.len()],
    /// What is seen of it.
    pub(crate) motion: Motion<f32>,
}

impl Course {
    /// Flights of a model that begin in a way, with so many steps in an action.
    pub(crate) fn new(setup: &Setup, start: &Start, substeps: u32) -> Self {
        let base = pattern::posture(start.posture);
        let inertial_from_body = facing_north(start.pitch);
        let motion = Motion {
            inertial_from_body,
            position: Vector::new(0.0, 0.0, START_HEIGHT),
            velocity: inertial_from_body.inverse() * Vector::new(0.0, 0.0, -start.speed),
            angular_velocity: Vector::zero(),
        };
        let mut inputs = setup.inputs;
        inputs.damping.pitch *= start.pitch_damping;
        let begun = Skydiver {
            state: State::from_motion(&motion, &setup.dynamics.hold(&base)),
            posture: base,
            amounts: [0.0; CONTROLS.len()],
            motion,
        };
        Self {
            dynamics: setup.dynamics,
            inputs,
            base,
            begun,
            substeps,
        }
    }

    /// A flight that begins.
    pub(crate) const fn begun(&self) -> Skydiver {
        self.begun
    }

    /// Time of an action (s).
    pub(crate) fn duration(&self) -> f64 {
        f64::from(self.substeps) * TIME_STEP
    }

    /// The base with amounts of the movement patterns.
    fn posture(&self, amounts: &[f32; CONTROLS.len()]) -> Posture<f32> {
        let mut posture = self.base;
        for (control, amount) in CONTROLS.iter().zip(amounts) {
            if *amount != 0.0 {
                add(&mut posture, control, *amount);
            }
        }
        posture
    }

    /// Flies an action, shares of the range of each control; `sample` is scratch.
    pub(crate) fn fly(
        &self,
        flight: &mut Skydiver,
        action: &[f32],
        sample: &mut PostureSample<f32>,
    ) {
        let duration = f32::of(self.duration());
        let reach = SPEED * duration;
        for (amount, wanted) in flight.amounts.iter_mut().zip(action) {
            *amount += (wanted.clamp(-1.0, 1.0) - *amount).clamp(-reach, reach);
        }
        let next = self.posture(&flight.amounts);
        self.dynamics
            .between_into(&flight.posture, &next, duration, sample);
        let density = self.dynamics.density_at(&flight.state);
        let step = f32::of(TIME_STEP);
        for _ in 0..self.substeps {
            let state = &flight.state;
            flight.state =
                self.dynamics
                    .step_at_density(state, &*sample, &self.inputs, step, density);
        }
        flight.posture = next;
        flight.motion = flight.state.motion(&*sample);
    }
}

/// Adds a share of a control's pattern.
fn add(posture: &mut Posture<f32>, control: &Control, share: f32) {
    let amount = share * control.limit;
    for &(segment, angles) in control.pattern {
        let [psi, theta, phi] = angles.map(|angle| f32::of(angle) * amount);
        let turn = joint_rotation(psi, theta, phi);
        let (segment, turn) = if control.mirrored {
            let mirrored = Quaternion::new(turn.w, turn.i, -turn.j, -turn.k);
            (segment.mirrored(), UnitQuaternion::new_unchecked(mirrored))
        } else {
            (segment, turn)
        };
        posture.set(segment, turn * posture.parent_from_segment(segment));
    }
}
