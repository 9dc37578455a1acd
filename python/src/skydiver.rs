//! One skydiver of many: movement patterns in, a motion out, at the lowest cost.
//!
//! Each action is one interval of the model: all its steps share the geometry at the middle of the interval and constant joint
//! rates. [`bodyflight_viewer::cockpit::Cockpit`] computes the geometry for every step instead; `tests/test_gym.py` bounds the
//! difference.

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::body::{Segment, pattern};
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::four::Four;
use bodyflight_core::frame::{Rotation, Vector, facing_north};
use bodyflight_core::math::{Lanes, clamp, usually};
use bodyflight_viewer::cockpit::{CONTROLS, Control, Start};
use bodyflight_viewer::setup::Setup;
use nalgebra::{Quaternion, SimdBool, SimdValue, UnitQuaternion};

use crate::side_by_side::{SIDE_BY_SIDE, Together};

/// Most that the amount of a control, -1 to 1, changes in a second. The viewer's page has the same limit.
const SPEED: f32 = 3.0;
/// Height at which flights begin (m).
const START_HEIGHT: f32 = 4000.0;

/// Everything that all flights share.
#[derive(Clone, Copy)]
pub(crate) struct Course<T: Lanes> {
    dynamics: Dynamics<T>,
    inputs: Inputs<T>,
    base: Posture<T>,
    /// A flight at its start.
    begun: Skydiver<T>,
    /// Steps of the model in one action.
    substeps: u32,
}

/// A flight in progress, or several side by side.
#[derive(Clone, Copy)]
pub(crate) struct Skydiver<T: Lanes> {
    state: State<T>,
    /// The base posture with the amounts.
    posture: Posture<T>,
    /// Amounts of the movement patterns.
    pub(crate) amounts: [T; CONTROLS.len()],
    /// Motion at the end of the last action.
    pub(crate) motion: Motion<T>,
}

/// Names of the numbers of a flight's motion, see [`Skydiver::numbers`].
pub(crate) const MOVING: [&str; 22] = [
    "attitude_w",
    "attitude_x",
    "attitude_y",
    "attitude_z",
    "cg_north_m",
    "cg_west_m",
    "cg_up_m",
    "momentum_north_kgmps",
    "momentum_west_kgmps",
    "momentum_up_kgmps",
    "angular_momentum_north_kgm2ps",
    "angular_momentum_west_kgm2ps",
    "angular_momentum_up_kgm2ps",
    "position_north_m",
    "position_west_m",
    "position_up_m",
    "velocity_left_mps",
    "velocity_dorsal_mps",
    "velocity_cranial_mps",
    "angular_velocity_left_radps",
    "angular_velocity_dorsal_radps",
    "angular_velocity_cranial_radps",
];
/// Number of the numbers that describe a flight to the bit.
pub(crate) const NUMBERS: usize = MOVING.len() + CONTROLS.len();

impl<T: Lanes> Skydiver<T> {
    /// Returns all that the flight consists of: the numbers of [`MOVING`], and the amounts of the controls.
    pub(crate) fn numbers(&self) -> [T; NUMBERS] {
        let (state, motion) = (&self.state, &self.motion);
        let vectors = [
            state.cg_position.to_array(),
            state.linear_momentum.to_array(),
            state.angular_momentum.to_array(),
            motion.position.to_array(),
            motion.velocity.to_array(),
            motion.angular_velocity.to_array(),
        ];
        let attitude = state.inertial_from_body.wxyz();
        let all = attitude.into_iter().chain(vectors.into_iter().flatten());
        let mut numbers = [T::zero(); NUMBERS];
        for (place, number) in numbers.iter_mut().zip(all.chain(self.amounts)) {
            *place = number;
        }
        numbers
    }
}

impl<T: Lanes> Skydiver<T> {
    /// Creates a flight of its [numbers](Skydiver::numbers) and the posture that its amounts give.
    fn of(numbers: &[T; NUMBERS], posture: Posture<T>) -> Self {
        let [
            w,
            x,
            y,
            z,
            cg_n,
            cg_w,
            cg_u,
            p_n,
            p_w,
            p_u,
            l_n,
            l_w,
            l_u,
            pos_n,
            pos_w,
            pos_u,
            v_l,
            v_d,
            v_c,
            w_l,
            w_d,
            w_c,
            amounts @ ..,
        ] = *numbers;
        // As it was: normalised once more, it would differ in the last bit.
        let attitude = UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z));
        let inertial_from_body = Rotation::from_quaternion(attitude);
        Self {
            state: State {
                inertial_from_body,
                cg_position: Vector::new(cg_n, cg_w, cg_u),
                linear_momentum: Vector::new(p_n, p_w, p_u),
                angular_momentum: Vector::new(l_n, l_w, l_u),
            },
            posture,
            amounts,
            motion: Motion {
                inertial_from_body,
                position: Vector::new(pos_n, pos_w, pos_u),
                velocity: Vector::new(v_l, v_d, v_c),
                angular_velocity: Vector::new(w_l, w_d, w_c),
            },
        }
    }
}

impl Skydiver<f32> {
    /// Posture at the end of the last action.
    pub(crate) const fn posture(&self) -> &Posture<f32> {
        &self.posture
    }
}

impl Together for Skydiver<Four> {
    type One = Skydiver<f32>;

    fn all(one: &Self::One) -> Self {
        let mut posture = Posture::h_pose();
        for segment in Segment::ALL {
            posture.set(
                segment,
                UnitQuaternion::splat(*one.posture.parent_from_segment(segment)),
            );
        }
        Self::of(&one.numbers().map(Four::splat), posture)
    }

    fn lane(&self, lane: usize) -> Self::One {
        let mut posture = Posture::h_pose();
        for segment in Segment::ALL {
            posture.set(
                segment,
                self.posture.parent_from_segment(segment).extract(lane),
            );
        }
        Skydiver::of(&self.numbers().map(|number| number.extract(lane)), posture)
    }

    fn put(&mut self, lane: usize, one: &Self::One) {
        for segment in Segment::ALL {
            let mut joint = *self.posture.parent_from_segment(segment);
            joint.replace(lane, *one.posture.parent_from_segment(segment));
            self.posture.set(segment, joint);
        }
        let mut numbers = self.numbers();
        for (number, one) in numbers.iter_mut().zip(one.numbers()) {
            number.replace(lane, one);
        }
        *self = Self::of(&numbers, self.posture);
    }
}

impl Course<f32> {
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

    /// Returns the same course for four flights side by side.
    pub(crate) fn for_four(&self) -> Course<Four> {
        Course {
            dynamics: self.dynamics.cast(),
            inputs: self.inputs.cast(),
            base: Skydiver::all(&self.begun).posture,
            begun: Skydiver::all(&self.begun),
            substeps: self.substeps,
        }
    }

    /// Returns a flight at its start.
    pub(crate) const fn begun(&self) -> Skydiver<f32> {
        self.begun
    }

    /// Duration of an action (s).
    pub(crate) fn duration(&self) -> f64 {
        f64::from(self.substeps) * TIME_STEP
    }

    /// Same as [`Course::fly`], with loads that others apply to the body.
    pub(crate) fn fly_under(
        &self,
        loads: &AppliedLoads<f32>,
        flight: &mut Skydiver<f32>,
        action: &[f32; CONTROLS.len()],
        sample: &mut PostureSample<f32>,
    ) {
        let half = f32::of(TIME_STEP) * f32::of(0.5);
        self.fly_watched(flight, action, sample, |_, posture, state, sample| {
            loads.push(&self.dynamics, state, (posture, sample), 0.0, half);
        });
    }

    /// Same as [`Course::fly_under`] for four flights side by side, which fly one after another.
    pub(crate) fn fly_four_under(
        &self,
        loads: &[AppliedLoads<f32>; SIDE_BY_SIDE],
        four: &mut Skydiver<Four>,
        actions: &[[f32; CONTROLS.len()]; SIDE_BY_SIDE],
        sample: &mut PostureSample<f32>,
    ) {
        for (lane, (loads, action)) in loads.iter().zip(actions).enumerate() {
            let mut flight = four.lane(lane);
            self.fly_under(loads, &mut flight, action, sample);
            four.put(lane, &flight);
        }
    }

    /// Returns a flight that moves as `motion` says, with these amounts of the movement patterns and joints at rest.
    pub(crate) fn moving(
        &self,
        motion: &Motion<f32>,
        amounts: [f32; CONTROLS.len()],
    ) -> Skydiver<f32> {
        let posture = self.posture(&amounts);
        Skydiver {
            state: State::from_motion(motion, &self.dynamics.hold(&posture)),
            posture,
            amounts,
            motion: *motion,
        }
    }

    /// Returns the flight with these numbers, which [`Skydiver::numbers`] returned.
    pub(crate) fn of_numbers(&self, numbers: &[f32; NUMBERS]) -> Skydiver<f32> {
        let mut flight = Skydiver::of(numbers, self.base);
        flight.posture = self.posture(&flight.amounts);
        flight
    }

    /// Returns posture and motion of a flight at its start.
    pub(crate) const fn at_start(&self) -> (Posture<f32>, Motion<f32>) {
        (self.base, self.begun.motion)
    }

    /// Same as [`Course::fly`]; returns posture and motion after each step of the model. Joints move at constant rates.
    pub(crate) fn watch(
        &self,
        flight: &mut Skydiver<f32>,
        action: &[f32; CONTROLS.len()],
    ) -> Vec<(Posture<f32>, Motion<f32>)> {
        let from = flight.posture;
        let (mut states, mut sample) = (Vec::new(), PostureSample::blank());
        self.fly_watched(flight, action, &mut sample, |when, _, state, _| {
            if when == When::After {
                states.push(*state);
            }
        });
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
}

/// When a step is looked at.
#[derive(Clone, Copy, PartialEq, Eq)]
enum When {
    Before,
    After,
}

impl<T: Lanes> Course<T> {
    /// Adds amounts of the movement patterns to the base posture.
    fn posture(&self, amounts: &[T; CONTROLS.len()]) -> Posture<T> {
        let mut posture = self.base;
        for (control, amount) in CONTROLS.iter().zip(amounts) {
            add(&mut posture, control, *amount);
        }
        posture
    }

    /// Flies one action, which holds a share of the range of each control; `sample` is scratch memory.
    pub(crate) fn fly(
        &self,
        flight: &mut Skydiver<T>,
        action: &[T; CONTROLS.len()],
        sample: &mut PostureSample<T>,
    ) {
        self.fly_watched(flight, action, sample, |_, _, _, _| ());
    }

    /// Flies one action and shows posture, state and sample to `each` before and after each step of the model.
    #[inline]
    fn fly_watched(
        &self,
        flight: &mut Skydiver<T>,
        action: &[T; CONTROLS.len()],
        sample: &mut PostureSample<T>,
        mut each: impl FnMut(When, &Posture<T>, &mut State<T>, &PostureSample<T>),
    ) {
        let (one, step) = (T::one(), T::of(TIME_STEP));
        let duration = T::of(f64::from(self.substeps) * TIME_STEP);
        let reach = T::single(SPEED) * duration;
        for (amount, wanted) in flight.amounts.iter_mut().zip(action) {
            *amount += clamp(clamp(*wanted, -one, one) - *amount, -reach, reach);
        }
        let next = self.posture(&flight.amounts);
        self.dynamics
            .between_into(&flight.posture, &next, duration, sample);
        let density = self.dynamics.density_at(&flight.state);
        let state = &mut flight.state;
        for _ in 0..self.substeps {
            each(When::Before, &next, state, sample);
            *state = self
                .dynamics
                .step_at_density(state, &*sample, &self.inputs, step, density);
            each(When::After, &next, state, sample);
        }
        flight.posture = next;
        flight.motion = flight.state.motion(&*sample);
    }
}

/// Adds a share of a control's movement pattern to a posture.
fn add<T: Lanes>(posture: &mut Posture<T>, control: &Control, share: T) {
    let still = share.simd_eq(T::zero());
    if still.all() {
        return;
    }
    let amount = share * T::single(control.limit);
    for &(segment, angles) in control.pattern {
        let [psi, theta, phi] = angles.map(|angle| T::of(angle) * amount);
        let turn = joint_rotation(psi, theta, phi);
        let (segment, turn) = if control.mirrored {
            let mirrored = Quaternion::new(turn.w, turn.i, -turn.j, -turn.k);
            (segment.mirrored(), UnitQuaternion::new_unchecked(mirrored))
        } else {
            (segment, turn)
        };
        let before = *posture.parent_from_segment(segment);
        posture.set(segment, usually(!still, || turn * before, || before));
    }
}
