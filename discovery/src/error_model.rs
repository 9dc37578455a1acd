//! The errors of a flight, estimated from the flight itself: variance components by restricted maximum likelihood.
//!
//! Constants (joint calibration, joint error proportional to the bend, gyroscope scale, subject and sensors) have
//! priors and are the same in all stretches. The wander of the joints, sensor noise and unexplained forces and moments
//! are drawn independently in every stretch: only their variances are fitted, never their values.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

pub use super::error_prior::{COMPONENTS, CONSTANTS, Components, OWN, PUSH, WANDER};
use super::error_prior::{Prior, Spread, wander};
use super::linearization::{Belief, Course};
use super::moments::{Moments, Weighed};
use super::nuisance::{Angles, JOINTS, JointErrors, SUBJECT, Subject};
use super::part::Part;
use super::progress::Progress;
use super::stretch::NUMBERS;

/// The errors of a flight.
#[derive(Debug, Clone)]
pub struct Errors {
    /// Variance components.
    pub sizes: Components,
    /// Standard deviations of the constants.
    pub spread: Spread,
    /// Estimates of the constants.
    pub constants: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Log-likelihood with the constants marginalized out, including the priors of the variances.
    pub likelihood: f64,
    /// Sum of squared whitened residuals of each stretch.
    pub squares: Vec<f64>,
}

impl Errors {
    /// Root mean square of the wander of a joint about an axis (rad).
    pub fn wander(&self) -> f64 {
        wander(&self.sizes)
    }

    /// Misfit per observation.
    pub fn misfit(&self) -> f64 {
        self.squares.iter().sum::<f64>() / (self.squares.len() * NUMBERS).max(1) as f64
    }

    /// The constants as a point of linearization, with the effects of `before`.
    pub fn belief(&self, before: &Belief) -> Belief {
        let mut joints = JointErrors::none();
        joints.course[0].copy_from(&self.constants.rows(0, JOINTS));
        joints.bend.copy_from(&self.constants.rows(JOINTS, JOINTS));
        Belief {
            effects: before.effects.clone(),
            subject: Subject(self.constants.rows(OWN, SUBJECT).into_owned()).possible(),
            joints,
            wander: BTreeMap::new(),
        }
    }

    /// The most likely wander in each stretch.
    pub fn likely_wander(&self, parts: &[Part]) -> BTreeMap<usize, Course> {
        let each = parts.par_iter();
        each.filter_map(|part| Some((part.first, self.wander_in(part)?)))
            .collect()
    }

    fn wander_in(&self, part: &Part) -> Option<Course> {
        let left = &part.missing - &part.constants * &self.constants;
        let pulled = part.covariance(&self.sizes)?.solve(&left) / part.weight;
        let mut course = [Angles::zeros(); 3];
        for ((angles, columns), k) in course.iter_mut().zip(&part.joints).zip(WANDER) {
            angles.copy_from(&(columns.tr_mul(&pulled) * self.sizes[k]));
        }
        Some(course)
    }
}

/// Gain below which the fit stops.
const SETTLED: f64 = 0.1;

/// The errors, and the flight weighted by them.
pub struct Estimate {
    /// The errors.
    pub errors: Errors,
    /// One for each stretch.
    pub(super) weighed: Vec<Weighed>,
    /// Information of the constants, without their prior.
    pub(super) information: DMatrix<f64>,
}

/// Fits the errors in at most `steps` Newton steps, starting from `start` if given, and stops early if the search is
/// cancelled. Returns `None` if a covariance is not positive definite.
pub fn fit(
    parts: &[Part],
    prior: &Prior,
    start: Option<&Errors>,
    steps: usize,
    progress: &dyn Progress,
) -> Option<Estimate> {
    let mut sizes = start.map_or_else(|| prior.start(), |errors| errors.sizes);
    for (k, (middle, deviation)) in prior.sizes.iter().enumerate() {
        if *deviation <= 0.0 {
            sizes[k] = middle.exp();
        }
    }
    let mut spread = start.map_or_else(|| Spread::new(&prior.tolerances), |errors| errors.spread);
    let mut best = Moments::new(parts, prior, &sizes, &spread)?;
    let mut damping = 1e-3;
    for _ in 0..steps {
        if progress.is_cancelled() {
            break;
        }
        let next_spread = best.spread(prior);
        let (slope, curvature) = best.slopes(parts, prior, &sizes);
        let mut gain = None;
        for _ in 0..6 {
            let mut damped = curvature;
            for k in 0..COMPONENTS {
                damped[(k, k)] *= 1.0 + damping;
            }
            let step = damped.cholesky()?.solve(&slope);
            let next = sizes.zip_map(&step, |size, step: f64| size * step.clamp(-2.0, 2.0).exp());
            let next = prior.limited(next);
            if let Some(found) = Moments::new(parts, prior, &next, &next_spread)
                && found.objective > best.objective - 1e-6
            {
                gain = Some(found.objective - best.objective);
                (sizes, spread, best) = (next, next_spread, found);
                damping *= 0.2;
                break;
            }
            damping = damping.max(1e-3) * 10.0;
        }
        if gain.is_none_or(|gain| gain < SETTLED) {
            break;
        }
    }
    let square = |(part, weighed): (&Part, &Weighed)| {
        let left = &part.missing - &part.constants * &best.constants;
        left.dot(&(&weighed.inverse * &left))
    };
    Some(Estimate {
        errors: Errors {
            sizes,
            spread,
            likelihood: best.likelihood,
            squares: parts.iter().zip(&best.weighed).map(square).collect(),
            constants: best.constants,
            covariance: best.covariance,
        },
        weighed: best.weighed,
        information: best.information,
    })
}
