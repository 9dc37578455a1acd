//! The errors of a flight, estimated from the flight itself: variance components by restricted maximum likelihood.
//!
//! Constants (joint calibration, joint error proportional to the bend, gyroscope scale, subject and sensors) have
//! priors and are the same in all stretches. The wander of the joints, sensor noise and unexplained forces and moments
//! are drawn independently in every stretch: only their variances are fitted, never their values.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::jacobian::layout::{COMPONENTS, Components};
use crate::jacobian::linearization_point::{LinearizationPoint, OWN, StretchErrors};
use crate::jacobian::subject_error::{SUBJECT, Subject};
use crate::likelihood::factor::{StretchFactor, WeighedFlight, WeightedStretch};
use crate::likelihood::prior::{Prior, PriorDeviations, wander};
use crate::likelihood::reml::RemlEvaluation;
use crate::progress::Progress;
use crate::shooting::joint_error::{JOINTS, JointErrors};

/// The errors of a flight.
#[derive(Debug, Clone)]
pub struct FittedErrors {
    /// Variance components.
    pub sizes: Components,
    /// Standard deviations of the constants.
    pub prior_deviations: PriorDeviations,
    /// Estimates of the constants.
    pub constants: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Log-likelihood with the constants marginalized out, including the priors of the variances.
    pub likelihood: f64,
    /// Sum of squared whitened residuals of each stretch.
    pub squares: Vec<f64>,
    /// Number of residuals.
    pub(crate) observations: usize,
}

impl FittedErrors {
    /// Root mean square of the wander of a joint about an axis (rad).
    pub fn wander(&self) -> f64 {
        wander(&self.sizes)
    }

    /// Misfit per observation.
    pub fn misfit(&self) -> f64 {
        self.squares.iter().sum::<f64>() / self.observations.max(1) as f64
    }

    /// The constants as a point of linearization, with the effects of `before`.
    pub fn point(&self, before: &LinearizationPoint) -> LinearizationPoint {
        let mut joints = JointErrors::none();
        joints.course[0].copy_from(&self.constants.rows(0, JOINTS));
        joints.bend.copy_from(&self.constants.rows(JOINTS, JOINTS));
        LinearizationPoint {
            effects: before.effects.clone(),
            subject: Subject(self.constants.rows(OWN, SUBJECT).into_owned()).possible(),
            joints,
            stretches: BTreeMap::new(),
        }
    }

    /// The most likely errors of each stretch.
    pub(crate) fn of_stretches(&self, parts: &[StretchFactor]) -> BTreeMap<usize, StretchErrors> {
        let of = |part: &StretchFactor| {
            let left = &part.residual - &*part.constants * &self.constants;
            let pulled = part.covariance(&self.sizes)?.solve(&left) / part.weight;
            Some((part.first, part.likely(&self.sizes, &pulled)))
        };
        parts.par_iter().filter_map(of).collect()
    }
}

/// Gain below which the fit stops.
const LEAST_GAIN: f64 = 0.1;

/// The errors, and the flight weighted by them.
pub(crate) struct ErrorFit {
    /// The errors.
    pub errors: FittedErrors,
    pub(crate) weighed: Arc<WeighedFlight>,
}

/// Fits the errors in at most `steps` Newton steps, starting from `start` if given, and stops early if the search is
/// cancelled. Returns `None` if a covariance is not positive definite.
pub(crate) fn fit(
    parts: &[StretchFactor],
    prior: &Prior,
    start: Option<&FittedErrors>,
    steps: usize,
    progress: &dyn Progress,
) -> Option<ErrorFit> {
    fit_from(parts, prior, (start, None), steps, progress)
}

/// The same, with the flight as a fit with the same slopes weighted it, if there is one. With its variances nothing needs
/// to be weighted again.
pub(crate) fn fit_from(
    parts: &[StretchFactor],
    prior: &Prior,
    (start, weighed): (Option<&FittedErrors>, Option<&Arc<WeighedFlight>>),
    steps: usize,
    progress: &dyn Progress,
) -> Option<ErrorFit> {
    let mut sizes = start.map_or_else(|| prior.start(), |errors| errors.sizes);
    for (k, (middle, deviation)) in prior.sizes.iter().enumerate() {
        if *deviation <= 0.0 {
            sizes[k] = middle.exp();
        }
    }
    let mut prior_deviations = start.map_or_else(
        || PriorDeviations::new(&prior.tolerances),
        |errors| errors.prior_deviations,
    );
    let weighed = match weighed {
        Some(weighed) => weighed.with(parts, &sizes)?,
        None => WeighedFlight::new(parts, &sizes)?,
    };
    let mut best = RemlEvaluation::of(weighed, parts, prior, &sizes, &prior_deviations)?;
    let mut damping = 1e-3;
    for _ in 0..steps {
        if progress.is_cancelled() {
            break;
        }
        let [fast, sure] = best.prior_deviations(prior);
        let (slope, curvature) = best.slopes(parts, prior, &sizes);
        let mut gain = None;
        for attempt in 0..6 {
            let next_spread = if attempt == 0 { fast } else { sure };
            let mut damped = curvature;
            for k in 0..COMPONENTS {
                damped[(k, k)] *= 1.0 + damping;
            }
            let step = damped.cholesky()?.solve(&slope);
            let next = sizes.zip_map(&step, |size, step: f64| size * step.clamp(-2.0, 2.0).exp());
            let next = prior.limited(next);
            if let Some(found) = RemlEvaluation::new(parts, prior, &next, &next_spread)
                && found.likelihood > best.likelihood - 1e-6
            {
                gain = Some(found.likelihood - best.likelihood);
                (sizes, prior_deviations, best) = (next, next_spread, found);
                damping *= 0.2;
                break;
            }
            damping = damping.max(1e-3) * 10.0;
        }
        if gain.is_none_or(|gain| gain < LEAST_GAIN) {
            break;
        }
    }
    let square = |(part, weighed): (&StretchFactor, &WeightedStretch)| {
        let left = &part.residual - &*part.constants * &best.constants;
        left.dot(&(&weighed.inverse * &left))
    };
    Some(ErrorFit {
        errors: FittedErrors {
            sizes,
            prior_deviations,
            likelihood: best.likelihood,
            observations: parts.iter().map(|part| part.residual.len()).sum(),
            squares: parts
                .iter()
                .zip(&best.weighed.stretches)
                .map(square)
                .collect(),
            constants: best.constants,
            covariance: best.covariance,
        },
        weighed: best.weighed,
    })
}
