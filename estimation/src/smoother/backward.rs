//! The backward pass over the intervals of a forward pass.

use bodyflight_core::estimator::motion::state::{
    Covariance, DAMPING, Difference, INPUT_STATES, MOTION_STATES, SPIN, STATES,
};
use bodyflight_core::estimator::motion::transition::MotionSlope;
use nalgebra::{SMatrix, SVector};

use super::{Effect, Pass, Step, Taken};
use crate::constants::{CONSTANTS, Constants, Found};

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
    /// The same of muscle input that is active.
    pub active: [Score; 3],
    /// The residual load.
    pub residual: Score,
    /// Muscle input and damping per interval; the first entry is the start.
    pub each: Vec<[Score; 6]>,
    /// Gradient of the log likelihood with respect to each damping coefficient that is due to the uncertainty of the angular
    /// velocity, at each interval's end, with how active muscle input is; the first entry is the start.
    pub pulls: Vec<[(f64, f64); 3]>,
}

impl Scores {
    /// The pulls as the flight asks for them. They are proportional to the assumed noise about an axis; where the flight has
    /// less than the least that is assumed, they would pull the damping away from what the measurements say.
    pub fn pulls_as_found(&self) -> Vec<[f64; 3]> {
        let weights = [0, 1, 2].map(|axis| {
            let found = [&self.quiet[axis], &self.active[axis]];
            found.map(|score| score.factor().min(1.0))
        });
        let weighted = |pulls: &[(f64, f64); 3]| {
            std::array::from_fn(|axis| {
                let ((pull, activity), [quiet, active]) = (pulls[axis], weights[axis]);
                pull * (quiet + activity * (active - quiet))
            })
        };
        self.pulls.iter().map(weighted).collect()
    }
}

/// The transpose of the propagation over an interval.
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
    /// Information about the change by each damping coefficient over the next interval, per angular velocity.
    damped: SMatrix<f64, STATES, 3>,
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
                damped: SMatrix::zeros(),
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
            let pulls = step.pulls(adjoint);
            let with_activity = |axis: usize| (pulls[axis], step.activity[axis]);
            self.scores.pulls.push(std::array::from_fn(with_activity));
            for (axis, pull) in step.pull.into_iter().enumerate() {
                adjoint.value[DAMPING + axis] -= pull;
            }
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
        self.scores.pulls.reverse();
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
            if let Some(active) = scores.active.get_mut(k) {
                active.add(found, expected, 1.0 - quiet);
            }
        }
        for a in 0..6 {
            for b in 0..6 {
                let weight = self.residual[(a, b)];
                let (found, expected) = (found(6 + a) * found(6 + b), expected(6 + a, 6 + b));
                scores.residual.add(found, expected, weight);
            }
        }
    }

    /// What pulls the damping in the next iteration.
    fn pulls(&self, adjoint: &Adjoint) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let known = adjoint.damped.column(axis);
            -self.covariance.row(SPIN + axis).transpose().dot(&known)
        })
    }

    /// Goes backward over the interval.
    fn back(&self, adjoint: &mut Adjoint) {
        let known = adjoint.information.fixed_columns::<MOTION_STATES>(0) * self.damped;
        adjoint.damped = uncrossed(&self.slope, &self.decay, &known);
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
