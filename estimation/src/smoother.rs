//! A fixed-interval smoother along a trajectory, with parameters that are constant over the flight.
//!
//! Errors are small differences from a trajectory. A Kalman filter with the algebra of the motion filter propagates
//! them forward. The modified Bryson-Frazier smoother (Bierman 1973) then runs backward over its steps, and collects
//! the information of later measurements in an adjoint. No covariance is inverted, so unobserved inputs do no harm.
//!
//! Constant parameters are separate, after Friedland (1969): the sensitivity of the filter's state and innovations to
//! each of them is propagated beside the filter; least squares over all innovations of the flight then gives their
//! values and covariance. They are errors of the recorded joints ([`joints`](super::joints)), and constant offsets of
//! muscle input and damping.
//!
//! The adjoint also gives the gradient of the likelihood with respect to the noise of each input: the ratio of its
//! square to the expected square is 1 if the noise is as large as assumed.

use bodyflight_core::estimator::motion::measurement::Row;
use bodyflight_core::estimator::motion::process::Process;
use bodyflight_core::estimator::motion::state::{
    Covariance, Difference, INPUT_STATES, MOTION_STATES, RESIDUAL_FORCE, STATES,
};
use bodyflight_core::estimator::motion::transition::{MotionSlope, spread};
use bodyflight_core::estimator::motion::update::{self, Innovation};
use nalgebra::{SMatrix, SVector};

use crate::constants::{CONSTANTS, Constants, Found, Information};
use crate::joints::{DIRECTIONS, Loads};

/// Sensitivity of the state to each constant.
type Effect = SMatrix<f64, STATES, CONSTANTS>;

/// A measured channel that was used in an update.
#[derive(Clone)]
struct Taken {
    slope: SVector<f64, 9>,
    spread: Difference<f64>,
    innovation: f64,
    variance: f64,
    /// Sensitivity of the innovation to each constant.
    effect: Constants,
}

/// An interval of the forward pass.
#[derive(Clone)]
struct Step {
    slope: MotionSlope<f64>,
    decay: SVector<f64, INPUT_STATES>,
    residual: SMatrix<f64, 6, 6>,
    activity: [f64; 3],
    taken: Vec<Taken>,
    /// Expected difference from the trajectory about which the problem is linearized.
    difference: Difference<f64>,
    covariance: Covariance<f64>,
    effect: Effect,
}

/// The forward pass along a trajectory.
#[derive(Clone)]
pub struct Pass {
    /// The intervals since the start, or since [`Pass::forget`].
    steps: Vec<Step>,
    difference: Difference<f64>,
    covariance: Covariance<f64>,
    effect: Effect,
    information: Information,
}

/// The smoothed estimate at an instant.
pub struct Smoothed {
    /// Correction to the trajectory.
    pub correction: Difference<f64>,
    /// Standard deviations after the correction.
    pub deviation: Difference<f64>,
}

/// Sums of squares found for a noise, and expected for it.
#[derive(Debug, Clone, Copy, Default)]
pub struct Score {
    found: f64,
    expected: f64,
}

impl Score {
    fn add(&mut self, found: f64, expected: f64, weight: f64) {
        self.found += weight * found;
        self.expected += weight * expected;
    }

    /// The sum of both scores.
    pub fn joined(self, other: &Self) -> Self {
        Self {
            found: self.found + other.found,
            expected: self.expected + other.expected,
        }
    }

    /// Factor by which to multiply the assumed variance.
    pub fn factor(&self) -> f64 {
        if self.expected > 0.0 {
            self.found / self.expected
        } else {
            1.0
        }
    }
}

/// Size of each noise relative to the assumed one.
#[derive(Debug, Clone, Default)]
pub struct Scores {
    /// Quiet muscle input and damping, each in pitch, yaw and roll.
    pub quiet: [Score; 6],
    /// The residual load.
    pub residual: Score,
    /// Muscle input and damping per interval; the first entry is the start.
    pub each: Vec<[Score; 6]>,
}

/// Propagates errors from the beginning of an interval to its end.
fn crossed<const N: usize>(
    slope: &MotionSlope<f64>,
    decay: &SVector<f64, INPUT_STATES>,
    errors: &SMatrix<f64, STATES, N>,
) -> SMatrix<f64, STATES, N> {
    let mut after = *errors;
    after
        .fixed_rows_mut::<MOTION_STATES>(0)
        .copy_from(&(slope * errors));
    for column in 0..N {
        for k in 0..INPUT_STATES {
            after[(MOTION_STATES + k, column)] *= decay[k];
        }
    }
    after
}

/// The transpose of [`crossed`].
fn uncrossed<const N: usize>(
    slope: &MotionSlope<f64>,
    decay: &SVector<f64, INPUT_STATES>,
    adjoint: &SMatrix<f64, STATES, N>,
) -> SMatrix<f64, STATES, N> {
    let motion = adjoint.fixed_rows::<MOTION_STATES>(0).into_owned();
    let mut before = slope.tr_mul(&motion);
    for column in 0..N {
        for k in 0..INPUT_STATES {
            before[(MOTION_STATES + k, column)] += decay[k] * adjoint[(MOTION_STATES + k, column)];
        }
    }
    before
}

/// Information from later measurements, in the backward pass.
struct Adjoint {
    value: Difference<f64>,
    information: Covariance<f64>,
    effect: Effect,
}

impl Pass {
    /// Starts before the first interval.
    pub fn new(start: &Covariance<f64>, difference: &Difference<f64>) -> Self {
        let mut effect = Effect::zeros();
        for k in 0..6 {
            effect[(MOTION_STATES + k, DIRECTIONS + k)] = 1.0;
        }
        Self {
            steps: vec![Step::start(start)],
            difference: *difference,
            covariance: *start,
            effect,
            information: Information::none(),
        }
    }

    /// Crosses an interval. `gap` is how far the model, run from the interval's beginning, ends from the trajectory;
    /// `loads` are those of the joint errors.
    pub fn cross(
        &mut self,
        slope: &MotionSlope<f64>,
        process: &Process<f64>,
        gap: &Difference<f64>,
        loads: &Loads,
    ) {
        let decay = process.decay();
        self.difference = crossed(slope, &decay, &self.difference) + gap;
        let mut effect = crossed(slope, &decay, &self.effect);
        let pushed = slope.fixed_view::<MOTION_STATES, 6>(0, RESIDUAL_FORCE) * loads;
        let mut motion = effect.fixed_view_mut::<MOTION_STATES, DIRECTIONS>(0, 0);
        motion += pushed;
        for k in 0..6 {
            effect[(MOTION_STATES + k, DIRECTIONS + k)] += 1.0 - decay[k];
        }
        self.effect = effect;
        spread(&mut self.covariance, slope, process);
        self.steps.push(Step {
            slope: *slope,
            decay,
            residual: process.residual_covariance(),
            activity: process.activity(),
            taken: Vec::new(),
            difference: self.difference,
            covariance: self.covariance,
            effect: self.effect,
        });
    }

    /// Updates with a channel at the end of the interval, unless it is more than `gate` deviations from its prediction.
    pub fn take(&mut self, row: &Row<f64>, noise: f64, gate: f64) {
        let (innovation, spread) =
            update::innovation(&self.covariance, &self.difference, row, noise);
        let Innovation { value, variance } = innovation;
        let within = value * value <= gate * gate * variance;
        if !within {
            return;
        }
        let effect = self
            .effect
            .fixed_rows::<MOTION_STATES>(0)
            .tr_mul(&row.slope);
        self.information.add(&effect, value, variance);
        self.effect -= spread * (effect.transpose() / variance);
        update::take(
            &mut self.covariance,
            &mut self.difference,
            &innovation,
            &spread,
        );
        if let Some(step) = self.steps.last_mut() {
            step.taken.push(Taken {
                slope: row.slope,
                spread,
                innovation: value,
                variance,
                effect,
            });
        }
    }

    /// Ends the interval: keeps the state after its updates for the backward pass.
    pub fn settle(&mut self) {
        update::keep_positive(&mut self.covariance);
        if let Some(step) = self.steps.last_mut() {
            step.difference = self.difference;
            step.covariance = self.covariance;
            step.effect = self.effect;
        }
    }

    /// What the flight says of the constants.
    pub fn information(&self) -> &Information {
        &self.information
    }

    /// Forgets the intervals so far, which a copy of the pass from before them can cross again.
    pub fn forget(&mut self) {
        self.steps.clear();
    }
}

/// The backward pass, from the end of the flight.
pub struct Backward<'a> {
    constants: &'a Found,
    adjoint: Adjoint,
    scores: Scores,
}

impl<'a> Backward<'a> {
    /// Starts at the end of the flight.
    pub fn new(constants: &'a Found) -> Self {
        Self {
            constants,
            adjoint: Adjoint {
                value: Difference::zeros(),
                information: Covariance::zeros(),
                effect: Effect::zeros(),
            },
            scores: Scores::default(),
        }
    }

    /// Runs backward over the intervals that a forward pass holds. Returns smoothed estimates at the end of each, the last
    /// first.
    pub fn over(&mut self, pass: &Pass) -> Vec<Smoothed> {
        let (adjoint, constants) = (&mut self.adjoint, self.constants);
        let steps = pass.steps.iter().rev();
        let smoothed = steps.map(|step| {
            let smoothed = step.smoothed(adjoint, constants);
            for taken in step.taken.iter().rev() {
                taken.back(adjoint, &constants.errors);
            }
            step.score(adjoint, constants, &mut self.scores);
            step.back(adjoint);
            smoothed
        });
        smoothed.collect()
    }

    /// Scores of the noises, at the start of the flight.
    pub fn scores(mut self) -> Scores {
        self.scores.each.reverse();
        self.scores
    }
}

impl Taken {
    /// Goes backward through an update: with `K = spread / variance`, `(1 - K H)^T` times the later adjoint, plus the
    /// channel's own innovation.
    fn back(&self, adjoint: &mut Adjoint, errors: &Constants) {
        let inverse = 1.0 / self.variance;
        let gain = self.spread * inverse;
        let innovation = self.innovation - self.effect.dot(errors);
        let seen = gain.dot(&adjoint.value) + innovation * inverse;
        let effect = adjoint.effect.tr_mul(&gain) + self.effect * inverse;
        let information = &mut adjoint.information;
        let column = *information * gain;
        let known = gain.dot(&column) + inverse;
        for k in 0..MOTION_STATES {
            let slope = self.slope[k];
            if slope == 0.0 {
                continue;
            }
            adjoint.value[k] -= slope * seen;
            for j in 0..CONSTANTS {
                adjoint.effect[(k, j)] -= slope * effect[j];
            }
            for j in 0..STATES {
                information[(k, j)] -= slope * column[j];
                information[(j, k)] -= slope * column[j];
            }
            for j in 0..MOTION_STATES {
                information[(k, j)] += slope * known * self.slope[j];
            }
        }
    }
}

impl Step {
    fn start(covariance: &Covariance<f64>) -> Self {
        Self {
            slope: MotionSlope::zeros(),
            decay: SVector::zeros(),
            residual: SMatrix::zeros(),
            activity: [0.0; 3],
            taken: Vec::new(),
            difference: Difference::zeros(),
            covariance: *covariance,
            effect: Effect::zeros(),
        }
    }

    fn smoothed(&self, adjoint: &Adjoint, constants: &Found) -> Smoothed {
        let correction =
            self.difference + self.effect * constants.errors - self.covariance * adjoint.value;
        let known = self.covariance * adjoint.information;
        let effect = self.effect + self.covariance * adjoint.effect;
        let by_constants = effect * constants.covariance;
        let mut deviation = Difference::zeros();
        for k in 0..STATES {
            let lost: f64 = (0..STATES)
                .map(|j| known[(k, j)] * self.covariance[(j, k)])
                .sum();
            let constants: f64 = by_constants.row(k).dot(&effect.row(k));
            deviation[k] = ((self.covariance[(k, k)] - lost).max(0.0) + constants).sqrt();
        }
        Smoothed {
            correction,
            deviation,
        }
    }

    /// Adds to the scores, at the end of the interval and before its measurements.
    fn score(&self, adjoint: &Adjoint, constants: &Found, scores: &mut Scores) {
        let inputs = adjoint.effect.fixed_rows::<INPUT_STATES>(MOTION_STATES);
        let by_constants = inputs * constants.covariance;
        let expected = |a: usize, b: usize| {
            let known = adjoint.information[(MOTION_STATES + a, MOTION_STATES + b)];
            known - by_constants.row(a).dot(&inputs.row(b))
        };
        let found = |k: usize| adjoint.value[MOTION_STATES + k];
        scores.each.push(std::array::from_fn(|k| Score {
            found: found(k) * found(k),
            expected: expected(k, k),
        }));
        for k in 0..6 {
            let (found, expected) = (found(k) * found(k), expected(k, k));
            let quiet = 1.0 - self.activity[k % 3];
            scores.quiet[k].add(found, expected, quiet);
        }
        for a in 0..6 {
            for b in 0..6 {
                let weight = self.residual[(a, b)];
                let (found, expected) = (found(6 + a) * found(6 + b), expected(6 + a, 6 + b));
                scores.residual.add(found, expected, weight);
            }
        }
    }

    /// Goes backward over the interval.
    fn back(&self, adjoint: &mut Adjoint) {
        adjoint.value = uncrossed(&self.slope, &self.decay, &adjoint.value);
        adjoint.effect = uncrossed(&self.slope, &self.decay, &adjoint.effect);
        // Phi = [slope; 0 decay]: Phi^T M Phi in the four blocks of M.
        let information = &mut adjoint.information;
        let motion = information
            .fixed_view::<MOTION_STATES, MOTION_STATES>(0, 0)
            .into_owned();
        let mixed = information
            .fixed_view::<MOTION_STATES, INPUT_STATES>(0, MOTION_STATES)
            .into_owned();
        let inputs = information
            .fixed_view::<INPUT_STATES, INPUT_STATES>(MOTION_STATES, MOTION_STATES)
            .into_owned();
        *information = self.slope.tr_mul(&(motion * self.slope));
        let mixed = self.slope.tr_mul(&mixed);
        for j in 0..INPUT_STATES {
            for i in 0..STATES {
                let value = mixed[(i, j)] * self.decay[j];
                information[(i, MOTION_STATES + j)] += value;
                information[(MOTION_STATES + j, i)] += value;
            }
            for i in 0..INPUT_STATES {
                information[(MOTION_STATES + i, MOTION_STATES + j)] +=
                    inputs[(i, j)] * self.decay[i] * self.decay[j];
            }
        }
    }
}
