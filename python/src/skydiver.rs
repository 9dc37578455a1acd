//! One skydiver of many: movement patterns in, a motion out, at the lowest cost.
//!
//! Each action is one interval of the model: all its steps share the geometry at the middle of the interval and constant joint
//! rates. [`bodyflight_viewer::cockpit::Cockpit`] computes the geometry for every step instead; `tests/test_gym.py` bounds the
//! difference.

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::pattern;
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::math::Real;
use bodyflight_viewer::cockpit::{CONTROLS, Control, Start};
use bodyflight_viewer::setup::Setup;
use nalgebra::{Quaternion, UnitQuaternion};

/// Most that the amount of a control, -1 to 1, changes in a second. The viewer's page has the same limit.
const SPEED: f32 = 3.0;
/// Height at which flights begin (m).
const START_HEIGHT: f32 = 4000.0;

/// Everything that all flights share.
pub(crate) struct Course {
    dynamics: Dynamics<f32>,
    inputs: Inputs<f32>,
    base: Posture<f32>,
    /// A flight at its start.
    begun: Skydiver,
    /// Steps of the model in one action.
    substeps: u32,
}

/// A flight in progress.
#[derive(Clone, Copy)]
pub(crate) struct Skydiver {
    state: State<f32>,
    posture: Posture<f32>,
    amounts: [f32; CONTROLS.len()],
    /// Motion at the end of the last action.
    pub(crate) motion: Motion<f32>,
}

impl Course {
    /// Creates the course of flights that begin as `start` says, with `substeps` steps of the model in each action.
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

    /// Returns a flight at its start.
    pub(crate) const fn begun(&self) -> Skydiver {
        self.begun
    }

    /// Duration of an action (s).
    pub(crate) fn duration(&self) -> f64 {
        f64::from(self.substeps) * TIME_STEP
    }

    /// Adds amounts of the movement patterns to the base posture.
    fn posture(&self, amounts: &[f32; CONTROLS.len()]) -> Posture<f32> {
        let mut posture = self.base;
        for (control, amount) in CONTROLS.iter().zip(amounts) {
            if *amount != 0.0 {
                add(&mut posture, control, *amount);
            }
        }
        posture
    }

    /// Flies one action, which holds a share of the range of each control; `sample` is scratch memory.
    pub(crate) fn fly(
        &self,
        flight: &mut Skydiver,
        action: &[f32; CONTROLS.len()],
        sample: &mut PostureSample<f32>,
    ) {
        self.fly_watched(flight, action, sample, |_| ());
    }

    /// Returns posture and motion of a flight at its start.
    pub(crate) const fn at_start(&self) -> (Posture<f32>, Motion<f32>) {
        (self.base, self.begun.motion)
    }

    /// Same as [`Course::fly`]; returns posture and motion after each step of the model. Joints move at constant rates.
    pub(crate) fn watch(
        &self,
        flight: &mut Skydiver,
        action: &[f32; CONTROLS.len()],
    ) -> Vec<(Posture<f32>, Motion<f32>)> {
        let from = flight.posture;
        let (mut states, mut sample) = (Vec::new(), PostureSample::blank());
        self.fly_watched(flight, action, &mut sample, |state| states.push(*state));
        let rate = PostureRate::between(&from, &flight.posture, f32::of(self.duration()));
        let mut share = 0.0;
        let watched = states.iter().map(|state| {
            share += 1.0 / f64::from(self.substeps);
            let posture = from.interpolated(&flight.posture, f32::of(share));
            let motion = state.motion(&self.dynamics.sample(&posture, &rate));
            (posture, motion)
        });
        watched.collect()
    }

    /// Flies one action and shows the state after each step of the model to `each`.
    #[inline]
    fn fly_watched(
        &self,
        flight: &mut Skydiver,
        action: &[f32; CONTROLS.len()],
        sample: &mut PostureSample<f32>,
        mut each: impl FnMut(&State<f32>),
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
            each(&flight.state);
        }
        flight.posture = next;
        flight.motion = flight.state.motion(&*sample);
    }
}

/// Adds a share of a control's movement pattern to a posture.
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
