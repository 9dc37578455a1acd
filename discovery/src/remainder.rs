//! The residual after joints, subject and effects have been fitted: whether an unknown force or moment acts, about
//! which axis and when.

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use schemars::JsonSchema;
use serde::Serialize;

use super::error::Result;
use super::error_model::{Components, Errors, PUSH, fit};
use super::error_prior::Prior;
use super::fitted::Fitted;
use super::problem::Problem;
use super::progress::{Progress, check};
use super::stretch::{NUMBERS, ROWS};

/// Gain of log-likelihood above which an unknown force or moment acts beyond what sensors, joints and subject can
/// explain.
const PUSHES: f64 = 12.0;

/// Unknown moment (N m) and force (N) in a tenth of a second below which they are too small to matter.
const IMMATERIAL: [f64; 2] = [1.5, 12.0];

/// Ratio of fitted to recorded noise of attitude and angular velocity above which the sensors no longer explain it.
const NOISIER: f64 = 2.0;

/// Maximum number of stretches reported.
const MOST: usize = 5;

/// Names of the body axes: left, dorsal, cranial.
const AXES: [&str; 3] = [
    "left-right axis (pitch)",
    "back-belly axis (yaw)",
    "head-foot axis (roll)",
];

/// The residual of a flight.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Remainder {
    /// Whether the residual exceeds what sensors, joints and subject can explain.
    pub is_unexplained: bool,
    /// Gain of log-likelihood if unknown forces and moments may act.
    pub gain: f64,
    /// Root mean square of the unknown moment by body axis: left, dorsal, cranial (N m).
    pub moment_nm: [f64; 3],
    /// Root mean square of the unknown force (N).
    pub force_n: [f64; 3],
    /// Joint wander about an axis, root mean square (degrees).
    pub wander_deg: f64,
    /// Whether the joints would have to be off by as much as a suit plausibly can be, constantly or wandering.
    pub is_beyond_suit: bool,
    /// Times of the stretches with the largest residuals (s).
    pub times_s: Vec<f64>,
    /// Summary in words.
    pub in_words: String,
}

/// The errors of a flight without unknown forces and moments.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub fn without_push(
    problem: &Problem<'_>,
    fitted: &Fitted,
    progress: &dyn Progress,
) -> Result<Option<Errors>> {
    let prior: Prior = problem.prior_with(&fitted.belief.effects).without_push();
    let estimate = fit(&fitted.parts, &prior, Some(&fitted.errors), 12, progress);
    check(progress)?;
    Ok(estimate.map(|estimate| estimate.errors))
}

impl Remainder {
    /// Creates the summary of a fit. `quiet` holds the errors without unknown forces and moments.
    pub fn new(problem: &Problem<'_>, fitted: &Fitted, quiet: Option<&Errors>) -> Self {
        let errors = &fitted.errors;
        let pushes = pushes(fitted);
        let gain = quiet.map_or(0.0, |quiet| errors.likelihood - quiet.likelihood);
        let size = |component: usize| errors.sizes[component].sqrt();
        let matters = PUSH
            .iter()
            .zip(IMMATERIAL)
            .any(|(k, least)| size(*k) > least);
        let limit = problem.prior.tolerances.joint_limit().to_degrees();
        let wander_deg = errors.wander().to_degrees();
        let noisier = (0..2).any(|k| size(k) > NOISIER * problem.noise[k]);
        let is_beyond_suit = fitted.is_beyond_suit();
        let mean = |k: usize| {
            let count = (pushes.len() * ROWS).max(1) as f64;
            let squares = pushes.iter().map(|(moment, force)| {
                let of = if k < 3 { moment } else { force };
                of.iter().map(|v| v[k % 3].powi(2)).sum::<f64>()
            });
            (squares.sum::<f64>() / count).sqrt()
        };
        let moment_nm = [0, 1, 2].map(mean);
        let force_n = [3, 4, 5].map(mean);
        let strength = |k: usize| {
            let (moment, force) = &pushes[k];
            let square = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm_squared).sum::<f64>();
            square(moment) / IMMATERIAL[0].powi(2) + square(force) / IMMATERIAL[1].powi(2)
        };
        let mut order: Vec<usize> = (0..pushes.len()).collect();
        order.sort_by(|a, b| strength(*b).total_cmp(&strength(*a)));
        order.truncate(MOST);
        let mut times_s: Vec<f64> = order
            .iter()
            .map(|k| problem.track.times[problem.stretches[*k].first])
            .collect();
        times_s.sort_by(f64::total_cmp);
        let is_pushed = matters && gain > PUSHES;
        let largest = |values: &[f64; 3]| {
            (0..3)
                .max_by(|a, b| values[*a].total_cmp(&values[*b]))
                .unwrap_or(0)
        };
        let in_words = if is_beyond_suit {
            format!(
                "the joints would have to be off by {limit:.0} degrees or more, the limit of a suit"
            )
        } else if is_pushed && size(PUSH[0]) / IMMATERIAL[0] > size(PUSH[1]) / IMMATERIAL[1] {
            let axis = largest(&moment_nm);
            format!(
                "a moment of about {:.0} N m about the {} that changes within tenths of a second",
                moment_nm[axis], AXES[axis]
            )
        } else if is_pushed {
            let axis = largest(&force_n);
            format!(
                "a force of about {:.0} N along the {} that changes within tenths of a second",
                force_n[axis], AXES[axis]
            )
        } else if noisier {
            "attitude and angular velocity disagree with the model by more than their noise"
                .to_owned()
        } else {
            "nothing beyond sensors, joints and subject".to_owned()
        };
        Self {
            is_unexplained: is_pushed || is_beyond_suit || noisier,
            gain,
            moment_nm,
            force_n,
            wander_deg,
            is_beyond_suit,
            times_s,
            in_words,
        }
    }
}

/// Moments (N m) and forces (N) of the windows of a stretch, body axes.
pub type Pushes = (Vec<Vector3<f64>>, Vec<Vector3<f64>>);

/// Estimated moments and forces of each stretch.
pub fn pushes(fitted: &Fitted) -> Vec<Pushes> {
    fitted
        .parts
        .par_iter()
        .map(|part| {
            let left = &part.missing - &part.constants * &fitted.errors.constants;
            let pulled = part
                .covariance(&fitted.errors.sizes)
                .map_or_else(|| DVector::zeros(NUMBERS), |factor| factor.solve(&left));
            let of = |k: usize| {
                let by = part.pushes[1 - k].tr_mul(&pulled) * fitted.errors.sizes[PUSH[k]];
                (0..ROWS)
                    .map(|row| by.fixed_rows::<3>(3 * row).into_owned())
                    .collect::<Vec<_>>()
            };
            (of(0), of(1))
        })
        .collect()
}

/// Misfit of the model as given by the files, with sensor noise alone.
pub(super) fn unadjusted(fitted: &[Fitted]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for fitted in fitted {
        let sensors = Components::from_fn(|k, _| {
            if k < 4 {
                fitted.errors.sizes[k]
            } else {
                1e-3 * fitted.errors.sizes[k].min(1e-6)
            }
        });
        for part in &fitted.parts {
            if let Some(factor) = part.covariance(&sensors) {
                sum += part.missing.dot(&factor.solve(&part.missing));
                count += NUMBERS as f64;
            }
        }
    }
    sum / f64::max(count, 1.0)
}
