//! The strengths of effects that change at random: whether the likelihood rises with them, and their estimates.

use std::sync::Arc;

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix3, SMatrix, Vector3};
use rayon::prelude::*;

use crate::jacobian::effect_parameters::random;
use crate::jacobian::finite_difference::random_effects;
use crate::jacobian::layout::{COMPONENTS, Components, FIRST_RANDOM, components};
use crate::jacobian::random_effects::{LOADS, RandomEffectColumns, covariance};
use crate::likelihood::factor::StretchFactor;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::Prior;
use crate::likelihood::reml::RemlEvaluation;
use crate::likelihood::variance_components::fit;
use crate::progress::Progress;
use crate::shooting::stretch::ROWS;

/// Initial strengths at which effects are tried.
pub(crate) const TRIED: [(Effect, [f64; PARAMETER_COUNT]); 3] = [
    (Effect::Turbulence, [1.2, 150.0, 0.0]),
    (Effect::MuscleOverTime, [0.3, 0.3, 0.3]),
    (Effect::DampingOverTime, [0.4, 0.4, 0.4]),
];

/// Prior deviation of the logarithm of a variance, so wide that it has no influence.
const UNKNOWN: f64 = 3.0;

/// Correlation times (s) of the loads that are tried instead of an effect, and their initial force (N) and moment (N
/// m).
const LOAD_TIMES: [f64; 2] = [0.3, 2.0];
const LOAD_TRIED: [f64; 2] = [40.0, 5.0];

/// Maximum number of steps of a fit of strengths.
const STRENGTH_STEPS: usize = 20;

/// Stretches with effects that change at random, each with its own size.
fn parts_with(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    effects: &EffectSet,
) -> Vec<StretchFactor> {
    let each = problem.stretches.par_iter().zip(&fitted.parts);
    each.map(|(stretch, part)| {
        let (track, point) = (problem.track, &fitted.point);
        let varying = random_effects(track, stretch, &problem.plain, point, effects);
        let mut part = part.clone();
        part.varying = varying.map(Arc::new);
        part
    })
    .collect()
}

/// For effects that may be absent: the slope of the likelihood in their strengths at zero, all axes together, in units
/// of its standard deviation in flights without them.
pub(crate) fn scores(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    tried: &EffectSet,
) -> Vec<f64> {
    let mut effects = random(&fitted.point.effects);
    effects.extend(tried);
    let parts = parts_with(problem, fitted, &effects);
    let prior = problem.prior.given(&fitted.point.effects);
    let errors = &fitted.errors;
    let Some(moments) =
        RemlEvaluation::new(&parts, &prior, &errors.sizes, &errors.prior_deviations)
    else {
        return vec![0.0; tried.len()];
    };
    let (slope, curvature) = moments.by_variance(&parts);
    let known = information_of_known(&curvature, &errors.sizes, &prior);
    let Some(known) = known.cholesky() else {
        return vec![0.0; tried.len()];
    };
    let of = |k: usize| {
        let information = information_alone(&curvature, &errors.sizes, &known, k);
        if information > 0.0 {
            (slope[k] / information.sqrt()).max(0.0)
        } else {
            0.0
        }
    };
    let each = tried.iter().map(|(effect, _)| {
        let squares = components(*effect).map(|k| of(k).powi(2));
        squares.sum::<f64>().sqrt()
    });
    each.collect()
}

/// Information of the variances.
type Curvature = SMatrix<f64, COMPONENTS, COMPONENTS>;

/// Information about a variance, with the error sizes that every flight has marginalized out.
fn information_alone(
    curvature: &Curvature,
    sizes: &Components,
    known: &Cholesky<f64, Dyn>,
    k: usize,
) -> f64 {
    let with_known = DVector::from_fn(FIRST_RANDOM, |j, _| curvature[(j, k)] * sizes[j]);
    curvature[(k, k)] - with_known.dot(&known.solve(&with_known))
}

/// Information about the logarithms of the error sizes that every flight has.
fn information_of_known(curvature: &Curvature, sizes: &Components, prior: &Prior) -> DMatrix<f64> {
    DMatrix::from_fn(FIRST_RANDOM, FIRST_RANDOM, |j, k| {
        let deviation = prior.sizes[k].1;
        let believed = if j == k && deviation > 0.0 {
            deviation.powi(-2)
        } else {
            0.0
        };
        curvature[(j, k)] * sizes[j] * sizes[k] + believed
    })
}

/// The flights in which strengths are estimated.
pub(crate) type Flights<'f, 'a> = [(&'f FlightProblem<'a>, &'f LinearFit)];

/// The strengths of an effect that fit all flights together, with the other errors refitted. Returns `None` if a
/// covariance is not positive definite.
///
/// Stretches are treated as independent, as with joint wander. Correlations between neighbouring stretches would
/// contain more information, but joints that wander for seconds would then be mistaken for the effect.
pub(crate) fn strengths(
    flights: &Flights<'_, '_>,
    effect: Effect,
    values: &[f64; PARAMETER_COUNT],
    progress: &dyn Progress,
) -> Option<[f64; PARAMETER_COUNT]> {
    let places = components(effect);
    let (mut sums, mut weights) = ([0.0; PARAMETER_COUNT], [0.0; PARAMETER_COUNT]);
    let tried = TRIED.iter().find(|(other, _)| *other == effect)?.1;
    for (problem, fitted) in flights {
        let mut prior = problem.prior.given(&fitted.point.effects);
        let mut from = fitted.errors.clone();
        for (axis, k) in places.clone().enumerate() {
            prior.sizes[k] = (2.0 * tried[axis].ln(), UNKNOWN);
            // Fits converge from above, but not from below.
            from.sizes[k] = values[axis].max(tried[axis]).powi(2);
        }
        let estimate = fit(&fitted.parts, &prior, Some(&from), STRENGTH_STEPS, progress)?;
        let sizes = &estimate.errors.sizes;
        let moments = RemlEvaluation::new(
            &fitted.parts,
            &prior,
            sizes,
            &estimate.errors.prior_deviations,
        )?;
        let (_, curvature) = moments.by_variance(&fitted.parts);
        for (axis, k) in places.clone().enumerate() {
            // Flights are weighted by the curvature in the variance itself.
            let weight = curvature[(k, k)].max(f64::MIN_POSITIVE);
            sums[axis] += weight * sizes[k];
            weights[axis] += weight;
        }
    }
    let mut found = *values;
    for axis in 0..places.len() {
        let parameter = effect.description().parameters[axis];
        let deviation = (sums[axis] / weights[axis]).sqrt();
        found[axis] = deviation.clamp(parameter.low, parameter.high);
    }
    Some(found)
}

/// Log-likelihood of a flight if, instead of effects, a force and a moment of unknown strength change at random, with
/// the most likely of several correlation times. Returns `None` if a covariance is not positive definite.
pub(crate) fn likelihood_of_loads(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    progress: &dyn Progress,
) -> Option<f64> {
    let of = |time: f64| {
        let mut parts = fitted.parts.clone();
        for part in &mut parts {
            part.varying = Some(Arc::new(RandomEffectColumns::loads(&part.pushes, time)));
        }
        let mut prior = problem.prior.given(&EffectSet::new());
        let mut from = fitted.errors.clone();
        for k in FIRST_RANDOM..COMPONENTS {
            from.sizes[k] = 0.0;
        }
        for k in LOADS {
            let tried = LOAD_TRIED[(k - LOADS.start) / 3].powi(2);
            prior.sizes[k] = (tried.ln(), UNKNOWN);
            from.sizes[k] = tried;
        }
        fit(&parts, &prior, Some(&from), STRENGTH_STEPS, progress)
    };
    let found: Option<Vec<_>> = LOAD_TIMES.into_iter().map(of).collect();
    let likelihoods = found?.into_iter().map(|found| found.errors.likelihood);
    likelihoods.reduce(f64::max)
}

/// What a flight reveals about the path of an effect: one value about each axis in every stretch.
struct Series {
    /// Information, with the constants marginalized out.
    information: DMatrix<f64>,
    /// Position in the air (m), time (s) and velocity through the air (m/s) of each stretch.
    places: Vec<(Vector3<f64>, f64, Vector3<f64>)>,
    stretch_s: f64,
}

impl Series {
    fn new(
        problem: &FlightProblem<'_>,
        fitted: &LinearFit,
        effect: Effect,
        sizes: &Components,
    ) -> Option<Self> {
        let parts = &fitted.parts;
        let prior = problem.prior.given(&fitted.point.effects);
        let moments = RemlEvaluation::new(parts, &prior, sizes, &fitted.errors.prior_deviations)?;
        let fixed: Option<Vec<DMatrix<f64>>> = parts
            .iter()
            .map(|part| part.varying.as_ref()?.fixed(effect))
            .collect();
        let fixed = fixed?;
        let count = 3 * parts.len();
        let mut information = DMatrix::zeros(count, count);
        let mut shared = DMatrix::zeros(moments.constants.len(), count);
        for (s, (weighed, fixed)) in moments.weighed.stretches.iter().zip(&fixed).enumerate() {
            let own = fixed.tr_mul(&(&weighed.inverse * fixed));
            information.view_mut((3 * s, 3 * s), (3, 3)).copy_from(&own);
            let with_constants = weighed.pulled.tr_mul(fixed);
            shared.columns_mut(3 * s, 3).copy_from(&with_constants);
        }
        information -= shared.tr_mul(&(&moments.covariance * &shared));
        let time = |k: usize| problem.track.samples[problem.stretches[k].first].time;
        let stretch_s = if parts.len() > 1 {
            time(1) - time(0)
        } else {
            1.0
        };
        let mut place = Vector3::zeros();
        let mut places = Vec::new();
        for (k, part) in parts.iter().enumerate() {
            let through_air = part.varying.as_ref()?.through_air;
            places.push((place, time(k), through_air));
            place += through_air * stretch_s;
        }
        Some(Self {
            information,
            places,
            stretch_s,
        })
    }

    /// Covariance between the means of an effect of unit strength over two stretches.
    fn between(&self, effect: Effect, s: usize, t: usize) -> Matrix3<f64> {
        let ((here, then, through_air), (there, now, _)) = (&self.places[s], &self.places[t]);
        // Each distance between windows counts as often as there are pairs with it.
        let each = (0..2 * ROWS - 1).map(|k| {
            let windows = k as f64 - (ROWS - 1) as f64;
            let pairs = ROWS as f64 - windows.abs();
            let more = windows * self.stretch_s / ROWS as f64;
            let apart = here - there + through_air * more;
            covariance(effect, &apart, then - now + more) * pairs
        });
        each.sum::<Matrix3<f64>>() / (ROWS * ROWS) as f64
    }

    fn covariance(&self, effect: Effect) -> DMatrix<f64> {
        let count = self.places.len();
        let mut matrix = DMatrix::zeros(3 * count, 3 * count);
        for s in 0..count {
            for t in 0..=s {
                let block = self.between(effect, s, t);
                matrix.view_mut((3 * s, 3 * t), (3, 3)).copy_from(&block);
                let mirrored = block.transpose();
                matrix.view_mut((3 * t, 3 * s), (3, 3)).copy_from(&mirrored);
            }
        }
        matrix
    }
}

/// Standard errors of the strengths of an effect: those of the sizes, widened because neighbouring stretches see the
/// same path.
pub(crate) fn standard_errors(
    flights: &Flights<'_, '_>,
    effect: Effect,
    values: &[f64; PARAMETER_COUNT],
) -> Option<[f64; PARAMETER_COUNT]> {
    let places = components(effect);
    let mut information = [0.0; PARAMETER_COUNT];
    for (problem, fitted) in flights {
        let sizes = &fitted.errors.sizes;
        let prior = problem.prior.given(&fitted.point.effects);
        let moments = RemlEvaluation::new(
            &fitted.parts,
            &prior,
            sizes,
            &fitted.errors.prior_deviations,
        )?;
        let (_, curvature) = moments.by_variance(&fitted.parts);
        let known = information_of_known(&curvature, sizes, &prior).cholesky()?;
        let series = Series::new(problem, fitted, effect, sizes)?;
        let together = series.covariance(effect);
        for (axis, k) in places.clone().enumerate() {
            let alone = information_alone(&curvature, sizes, &known, k);
            let axes = if places.len() == 1 {
                0..3
            } else {
                axis..axis + 1
            };
            let wider = series.lasting(&together, axes, values[axis].powi(2));
            information[axis] += alone.max(0.0) / wider;
        }
    }
    let mut errors = [0.0; PARAMETER_COUNT];
    for axis in 0..places.len() {
        // Near a variance of zero, its root has no finite slope.
        let variance = values[axis].powi(2);
        let deviation = information[axis].max(f64::MIN_POSITIVE).sqrt().recip();
        errors[axis] = (variance + deviation).sqrt() - variance.sqrt();
    }
    Some(errors)
}

impl Series {
    /// Factor by which the variance of a slope in a size exceeds that for independent stretches.
    fn lasting(
        &self,
        covariance: &DMatrix<f64>,
        axes: core::ops::Range<usize>,
        variance: f64,
    ) -> f64 {
        let count = self.places.len();
        let (first, width) = (axes.start, axes.len());
        let block = |matrix: &DMatrix<f64>, s: usize, t: usize| {
            matrix
                .view((3 * s + first, 3 * t + first), (width, width))
                .into_owned()
        };
        let pulls: Vec<DMatrix<f64>> = (0..count)
            .map(|s| {
                let own = block(&self.information, s, s);
                &own * block(covariance, s, s) * &own
            })
            .collect();
        let (mut alone, mut shared) = (0.0, 0.0);
        for s in 0..count {
            alone += (&pulls[s] * block(covariance, s, s)).trace();
            for t in (0..count).filter(|t| *t != s) {
                let both = block(covariance, s, t);
                let alike = &pulls[s] * &both * &pulls[t] * both.transpose();
                shared += alike.trace() * variance * variance;
            }
        }
        if alone > 0.0 {
            1.0 + shared / alone
        } else {
            1.0
        }
    }
}
