//! The model linearised about the trimmed fall of the neutral pose, with every angle of every joint as an input.
//!
//! A moving limb acts by its place (the airstream) and by its rate (momentum); in momentum form the model needs no
//! acceleration. With a(t) an angle, `dx/dt = A x + B0 a + B1 da/dt` and `y = C x + D0 a + D1 da/dt`. The steps of the
//! simulation are linearised, and A, B are those whose exact solution the linearised steps are.

use core::f64::consts::FRAC_PI_2;

use bodyflight_core::body::pattern::{self, moved};
use bodyflight_core::dynamics::steady::steady;
use bodyflight_core::dynamics::step::TIME_STEP;
use bodyflight_core::dynamics::trim::{TrimError, trim, with_knees};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
use bodyflight_core::frame::{Vector, facing_north};
use bodyflight_core::observation::Observation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{Const, DMatrix, DVector, LU, SMatrix, SVector};

use super::axes::pattern as of_weights;
use crate::stability::{DISTURBANCE, STATES, difference, disturbed, slope};
use bodyflight_core::body::joint_angle::JointAngle;

/// Number of outputs.
pub const OUTPUTS: usize = 5;
/// Names and units of the outputs.
pub const OUTPUT_NAMES: [&str; OUTPUTS] = [
    "turn_rate_radps",
    "fall_rate_mps",
    "forward_drift_mps",
    "left_drift_mps",
    "pitch_rad",
];
/// Change of an angle for a derivative (rad), and of its rate (rad/s).
const ANGLE: f64 = 1e-4;
const RATE: f64 = 1e-2;
/// Fastest fall that is one (m/s).
const FASTEST_MPS: f64 = 200.0;

type Matrix = SMatrix<f64, STATES, STATES>;
type Column = SVector<f64, STATES>;
type Seen = SVector<f64, OUTPUTS>;

/// The steady fall about which the model is linearised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SteadyFall {
    /// Fall rate (m/s).
    pub fall_rate: f64,
    /// Rotation about the left axis from upright (rad).
    pub body_pitch: f64,
    /// Bend of the knees (rad) that makes it vertical; `None` if none does, and the neutral pose glides.
    pub knee: Option<f64>,
    /// Horizontal for vertical speed, positive towards the head.
    pub glide: f64,
}

/// A steady fall and its linear model.
#[derive(Debug, Clone)]
pub struct Linear {
    /// The fall.
    pub fall: SteadyFall,
    /// The trimmed posture.
    pub posture: Posture<f64>,
    /// Its motion.
    pub motion: Motion<f64>,
    /// The conscious inputs, constant.
    pub inputs: Inputs<f64>,
    /// State matrix (1/s); states are rotation (rad), velocity (m/s) and angular velocity (rad/s) that the body has in the
    /// trimmed posture with its momenta.
    pub states: Matrix,
    /// State after a step for that before it.
    step: Matrix,
    /// State after a step with a constant input, for the input: the integral of exp(A t).
    held: LU<f64, Const<STATES>, Const<STATES>>,
    seen: SMatrix<f64, OUTPUTS, STATES>,
    /// For each angle: change of the state in a step per angle and per rate, then of the outputs.
    columns: Vec<([Column; 2], [Seen; 2])>,
}

/// The linear model of one pattern.
#[derive(Debug, Clone)]
pub struct Single {
    /// State matrix (1/s).
    pub states: Matrix,
    /// Change of the state per angle and per rate.
    pub input: [Column; 2],
    /// Outputs per state.
    pub seen: SMatrix<f64, OUTPUTS, STATES>,
    /// Outputs per angle and per rate.
    pub direct: [Seen; 2],
    step: Matrix,
    step_input: [Column; 2],
}

/// What is observed of a body.
pub fn outputs(motion: &Motion<f64>) -> Seen {
    let observed = Observation::of(motion);
    let velocity = motion.velocity_inertial();
    Seen::from([
        observed.yaw_rate,
        -observed.vertical_velocity,
        velocity.north(),
        velocity.west(),
        observed.angles.pitch,
    ])
}

impl Linear {
    /// Linearises about the trim of the neutral pose, or about its glide if no bend of the knees makes it fall straight.
    ///
    /// # Errors
    /// Returns an error if the neutral pose has no steady fall.
    pub fn of(
        dynamics: &Dynamics<f64>,
        inputs: &Inputs<f64>,
        axes: &[JointAngle],
    ) -> Result<Self, TrimError> {
        let (fall, posture, motion) = balanced(dynamics, inputs)?;
        let sample = dynamics.hold(&posture);
        let step = slope(dynamics, &sample, inputs, &motion);
        let seen = derivative(DISTURBANCE, STATES, |column, by| {
            let mut disturbance = Column::zeros();
            disturbance[column] = by;
            outputs(&disturbed(&motion, &disturbance))
        });
        let start = State::from_motion(&motion, &sample);
        let effect = |moving: &PostureSample<f64>| {
            let next = dynamics.step(&start, moving, inputs, TIME_STEP);
            (
                difference(&motion, &next.motion(&sample)),
                outputs(&start.motion(moving)),
            )
        };
        let column = |axis: &JointAngle| {
            let along: &[(Segment, [f64; 3])] = &[(axis.segment, axis.shares())];
            let at = |by: f64| moved(&posture, along, by);
            let half = 0.5 * RATE * TIME_STEP;
            let held = [ANGLE, -ANGLE].map(|by| effect(&dynamics.hold(&at(by))));
            let moving =
                [half, -half].map(|by| effect(&dynamics.between(&at(-by), &at(by), TIME_STEP)));
            let slope = |[plus, minus]: &[(Column, Seen); 2], size: f64| {
                let by = 0.5 / size;
                ((plus.0 - minus.0) * by, (plus.1 - minus.1) * by)
            };
            let (held, moving) = (slope(&held, ANGLE), slope(&moving, RATE));
            ([held.0, moving.0], [held.1, moving.1])
        };
        let states = logarithm(&step) / TIME_STEP;
        Ok(Self {
            fall,
            posture,
            motion,
            inputs: *inputs,
            states,
            step,
            held: integral(&states).lu(),
            seen: SMatrix::from_columns(&seen),
            columns: axes.iter().map(column).collect(),
        })
    }

    /// The model of a pattern, from weights in the order of the axes.
    pub fn of_pattern(&self, weights: &DVector<f64>) -> Single {
        let mut sum = ([Column::zeros(); 2], [Seen::zeros(); 2]);
        for ((input, direct), weight) in self.columns.iter().zip(weights.iter()) {
            for k in 0..2 {
                sum.0[k] += input[k] * *weight;
                sum.1[k] += direct[k] * *weight;
            }
        }
        let input = (sum.0).map(|column| self.held.solve(&column).unwrap_or(column));
        Single {
            states: self.states,
            input,
            seen: self.seen,
            direct: sum.1,
            step: self.step,
            step_input: sum.0,
        }
    }

    /// The linear turn rate (rad/s) at each row of joint angles after the first, each a time (s) and changes from the mean
    /// (rad). Between rows angles change at constant rates.
    pub fn driven(&self, rows: &[(f64, DVector<f64>)]) -> Vec<f64> {
        let mut state = Column::zeros();
        let each = rows.windows(2).map(|pair| {
            let ((from, before), (to, after)) = (&pair[0], &pair[1]);
            let duration = to - from;
            let rate = (after - before) / duration;
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "frames are close to each other"
            )]
            let steps = (duration / TIME_STEP).round().clamp(1.0, 240.0) as u32;
            let mut turn = 0.0;
            for k in 0..steps {
                let share = (f64::from(k) + 0.5) / f64::from(steps);
                let mut direct = Seen::zeros();
                let mut next = self.step * state;
                for (axis, (input, seen)) in self.columns.iter().enumerate() {
                    let angle = before[axis] + (after[axis] - before[axis]) * share;
                    next += input[0] * angle + input[1] * rate[axis];
                    direct += seen[0] * angle + seen[1] * rate[axis];
                }
                state = next;
                turn = (self.seen * state + direct)[0];
            }
            turn
        });
        each.collect()
    }

    /// The full simulation of a pattern whose amplitude (rad) at each step is `amplitude`: outputs during each step, less
    /// those of the trim. `None` if it diverges.
    pub fn flown(
        &self,
        dynamics: &Dynamics<f64>,
        axes: &[JointAngle],
        weights: &DVector<f64>,
        amplitude: &[f64],
    ) -> Option<Vec<Seen>> {
        let along = of_weights(axes, weights);
        let at = |by: f64| moved(&self.posture, &along, by);
        let sample = dynamics.hold(&self.posture);
        let trimmed = outputs(&self.motion);
        let mut state = State::from_motion(&self.motion, &sample);
        let mut seen = Vec::new();
        for pair in amplitude.windows(2) {
            let moving = dynamics.between(&at(pair[0]), &at(pair[1]), TIME_STEP);
            state = dynamics.step(&state, &moving, &self.inputs, TIME_STEP);
            if !state.is_finite() {
                return None;
            }
            seen.push(outputs(&state.motion(&moving)) - trimmed);
        }
        Some(seen)
    }
}

impl Single {
    /// A model whose input acts by its place on the states alone.
    #[cfg(test)]
    pub(super) fn plain(states: Matrix, held: Column, seen: SMatrix<f64, OUTPUTS, STATES>) -> Self {
        Self {
            states,
            input: [held, Column::zeros()],
            seen,
            direct: [Seen::zeros(); 2],
            step: Matrix::identity() + states * TIME_STEP,
            step_input: [held * TIME_STEP, Column::zeros()],
        }
    }

    /// The linear response to the same amplitudes as [`Linear::flown`].
    pub fn response(&self, amplitude: &[f64]) -> Vec<Seen> {
        let mut state = Column::zeros();
        let each = amplitude.windows(2).map(|pair| {
            let middle = 0.5 * (pair[0] + pair[1]);
            let rate = (pair[1] - pair[0]) / TIME_STEP;
            state = self.step * state + self.step_input[0] * middle + self.step_input[1] * rate;
            self.seen * state + self.direct[0] * middle + self.direct[1] * rate
        });
        each.collect()
    }
}

/// The neutral pose in a steady fall.
fn balanced(
    dynamics: &Dynamics<f64>,
    inputs: &Inputs<f64>,
) -> Result<(SteadyFall, Posture<f64>, Motion<f64>), TrimError> {
    let neutral = pattern::neutral();
    let (fall, posture, motion) = match trim(dynamics, &neutral, 0.0) {
        Ok(trim) => {
            let attitude = facing_north(trim.body_pitch);
            let motion = Motion {
                inertial_from_body: attitude,
                position: Vector::zero(),
                velocity: attitude.inverse() * Vector::new(0.0, 0.0, -trim.terminal_speed),
                angular_velocity: Vector::zero(),
            };
            let fall = SteadyFall {
                fall_rate: trim.terminal_speed,
                body_pitch: trim.body_pitch,
                knee: Some(trim.knee),
                glide: 0.0,
            };
            (fall, with_knees(&neutral, trim.knee), motion)
        }
        Err(error) => {
            let density = dynamics.air.density.at(0.0);
            let found = steady(dynamics, &neutral, inputs, FRAC_PI_2, density).ok_or(error)?;
            let fall = SteadyFall {
                fall_rate: -found.motion.velocity_inertial().up(),
                body_pitch: found.body_pitch,
                knee: None,
                glide: found.glide,
            };
            (fall, neutral, found.motion)
        }
    };
    // The air of a vacuum chamber carries a body at a speed that means nothing.
    if !(fall.fall_rate > 0.0 && fall.fall_rate < FASTEST_MPS) {
        return Err(TrimError::NoSupport);
    }
    Ok((fall, posture, motion))
}

/// Central differences of a function of a column and a disturbance of it.
fn derivative(size: f64, columns: usize, function: impl Fn(usize, f64) -> Seen) -> Vec<Seen> {
    (0..columns)
        .map(|column| (function(column, size) - function(column, -size)) / (2.0 * size))
        .collect()
}

/// The logarithm of a matrix near the identity, as the step of a simulation is.
fn logarithm(matrix: &Matrix) -> Matrix {
    let apart = matrix - Matrix::identity();
    let (mut power, mut sum) = (apart, apart);
    for order in 2..60 {
        power = -power * apart;
        sum += power / f64::from(order);
    }
    sum
}

/// The integral of exp(A t) over a step.
fn integral(states: &Matrix) -> Matrix {
    let mut term = Matrix::identity() * TIME_STEP;
    let mut sum = term;
    for order in 2..12 {
        term = term * states * (TIME_STEP / f64::from(order));
        sum += term;
    }
    sum
}

/// The state matrix as one of variable size, for eigenvalues.
pub fn variable(matrix: &Matrix) -> DMatrix<f64> {
    DMatrix::from_iterator(STATES, STATES, matrix.iter().copied())
}
