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
//! Damping multiplies an angular velocity that is itself uncertain. The most likely trajectory and damping together are
//! biased: an angular velocity that is mostly noise is explained best by a damping that lets the noise grow. The likelihood
//! of the damping alone, over all trajectories, has one more term, the covariance of the angular velocity with what changes
//! it in the next interval. Its gradient [pulls](backward::Scores::pulls) the damping in the next iteration.
//!
//! The adjoint also gives the gradient of the likelihood with respect to the noise of each input: the ratio of its
//! square to the expected square is 1 if the noise is as large as assumed.

pub mod backward;

use bodyflight_core::estimator::motion::measurement::Row;
use bodyflight_core::estimator::motion::process::Process;
use bodyflight_core::estimator::motion::state::{
    Covariance, DAMPING, Difference, INPUT_STATES, MOTION_STATES, RESIDUAL_FORCE, STATES,
};
use bodyflight_core::estimator::motion::transition::{MotionSlope, spread};
use bodyflight_core::estimator::motion::update::{self, Innovation};
use nalgebra::{SMatrix, SVector};

use crate::constants::{CONSTANTS, Constants, Information};
use crate::joints::{DIRECTIONS, Loads};

/// Change of the motion over an interval by each damping coefficient, per angular velocity about its axis.
pub type Damped = SMatrix<f64, MOTION_STATES, 3>;

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
    damped: Damped,
    /// What pulled the damping after the measurements.
    pull: [f64; 3],
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
        damped: &Damped,
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
            damped: *damped,
            pull: [0.0; 3],
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

    /// Pulls the damping at the end of the interval by a gradient of the log likelihood.
    pub fn pull(&mut self, pull: [f64; 3]) {
        for (axis, pull) in pull.into_iter().enumerate() {
            self.information
                .pull(&self.effect.row(DAMPING + axis).transpose(), pull);
            self.difference += self.covariance.column(DAMPING + axis) * pull;
        }
        if let Some(step) = self.steps.last_mut() {
            step.pull = pull;
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

    /// Sum of the logarithms of the variances of all innovations.
    #[cfg(test)]
    pub fn log_determinant(&self) -> f64 {
        let taken = self.steps.iter().flat_map(|step| &step.taken);
        taken.map(|taken| taken.variance.ln()).sum()
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

impl Step {
    fn start(covariance: &Covariance<f64>) -> Self {
        Self {
            slope: MotionSlope::zeros(),
            decay: SVector::zeros(),
            damped: Damped::zeros(),
            pull: [0.0; 3],
            residual: SMatrix::zeros(),
            activity: [0.0; 3],
            taken: Vec::new(),
            difference: Difference::zeros(),
            covariance: *covariance,
            effect: Effect::zeros(),
        }
    }
}
