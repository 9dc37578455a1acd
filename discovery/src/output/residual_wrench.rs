//! The residual after joints, subject and effects have been fitted: whether an unknown force or moment acts, about
//! which axis and when.

use nalgebra::{DVector, Vector3};
use rayon::prelude::*;
use serde::Serialize;

use crate::hypotheses::decision::DECISION;
use crate::jacobian::layout::WRENCH;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::variance_components::FittedErrors;

/// Maximum number of stretches reported.
const STRETCHES: usize = 5;

/// Names of the body axes: left, dorsal, cranial.
const AXES: [&str; 3] = [
    "left-right axis (pitch)",
    "back-belly axis (yaw)",
    "head-foot axis (roll)",
];

/// The residual of a flight.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
    /// Whether the joints would have to be off by nearly as much as a suit plausibly can be, constantly or wandering.
    pub is_beyond_suit: bool,
    /// Times of the stretches with the largest residuals (s).
    pub times_s: Vec<f64>,
    /// Summary in words.
    pub in_words: String,
}

impl Remainder {
    /// Creates the summary of a fit. `quiet` holds the errors without unknown forces and moments.
    pub fn new(
        problem: &FlightProblem<'_>,
        fitted: &LinearFit,
        quiet: Option<&FittedErrors>,
    ) -> Self {
        let errors = &fitted.errors;
        let pushes = pushes(fitted);
        let gain = quiet.map_or(0.0, |quiet| errors.likelihood - quiet.likelihood);
        let size = |component: usize| errors.sizes[component].sqrt();
        let matters = WRENCH
            .iter()
            .zip(DECISION.immaterial_wrench)
            .any(|(k, least)| size(*k) > least);
        let limit = problem.prior.tolerances.joint_limit_deg();
        let wander_deg = errors.wander().to_degrees();
        let noisier = (0..2).any(|k| size(k) > DECISION.noise_ratio * problem.noise[k]);
        let is_beyond_suit = fitted.is_beyond_suit();
        let moment_nm = [0, 1, 2].map(|k| rms(&pushes, k));
        let force_n = [3, 4, 5].map(|k| rms(&pushes, k));
        let strength = |k: usize| {
            let (moment, force) = &pushes[k];
            let square = |v: &[Vector3<f64>]| v.iter().map(Vector3::norm_squared).sum::<f64>();
            square(moment) / DECISION.immaterial_wrench[0].powi(2)
                + square(force) / DECISION.immaterial_wrench[1].powi(2)
        };
        let mut order: Vec<usize> = (0..pushes.len()).collect();
        order.sort_by(|a, b| strength(*b).total_cmp(&strength(*a)));
        order.truncate(STRETCHES);
        let mut times_s: Vec<f64> = order
            .iter()
            .map(|k| problem.track.samples[problem.stretches[*k].first].time)
            .collect();
        times_s.sort_by(f64::total_cmp);
        let is_pushed = matters && gain > DECISION.refit_allowance();
        let largest = |values: &[f64; 3]| {
            (0..3)
                .max_by(|a, b| values[*a].total_cmp(&values[*b]))
                .unwrap_or(0)
        };
        let in_words = if is_beyond_suit {
            format!(
                "the joints would have to be off by nearly as much as a suit's ever are, {limit:.0} degrees"
            )
        } else if is_pushed
            && size(WRENCH[0]) / DECISION.immaterial_wrench[0]
                > size(WRENCH[1]) / DECISION.immaterial_wrench[1]
        {
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

/// Root mean square of a component of the wrenches: 0 to 2 moments (N m), 3 to 5 forces (N).
fn rms(wrenches: &[WrenchesOfStretch], k: usize) -> f64 {
    let windows = wrenches.iter().map(|(moment, _)| moment.len());
    let count = windows.sum::<usize>().max(1) as f64;
    let squares = wrenches.iter().map(|(moment, force)| {
        let of = if k < 3 { moment } else { force };
        of.iter().map(|v| v[k % 3].powi(2)).sum::<f64>()
    });
    (squares.sum::<f64>() / count).sqrt()
}

/// Moments (N m) and forces (N) of the windows of a stretch, body axes.
pub type WrenchesOfStretch = (Vec<Vector3<f64>>, Vec<Vector3<f64>>);

/// Estimated moments and forces of each stretch.
pub fn pushes(fitted: &LinearFit) -> Vec<WrenchesOfStretch> {
    fitted
        .parts
        .par_iter()
        .map(|part| {
            let left = &part.residual - &*part.constants * &fitted.errors.constants;
            let pulled = part
                .covariance(&fitted.errors.sizes)
                .map_or_else(|| DVector::zeros(left.len()), |factor| factor.solve(&left));
            let of = |k: usize| {
                let by = part.pushes[1 - k].tr_mul(&pulled) * fitted.errors.sizes[WRENCH[k]];
                (0..by.len() / 3)
                    .map(|row| by.fixed_rows::<3>(3 * row).into_owned())
                    .collect::<Vec<_>>()
            };
            (of(0), of(1))
        })
        .collect()
}
