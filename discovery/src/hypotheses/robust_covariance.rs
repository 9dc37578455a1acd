//! Factors by which the standard errors of an effect exceed those of the linear problem.
//!
//! The joint wander is modelled as independent in every stretch but persists for seconds, so neighbouring stretches
//! bias an effect alike. The linear problem also cannot see its own errors, but held-out flights reveal them.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::PARAMETER_COUNT;
use nalgebra::{DMatrix, DVector};

use crate::hypotheses::hypothesis::{Estimates, Hypothesis};
use crate::hypotheses::score_test::JointFit;
use crate::jacobian::effect_parameters::{ParameterId, moved, parameters_of};
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::random_effect_fit::standard_errors;
use crate::progress::Progress;

/// Number of neighbouring stretches whose influence may be correlated (Newey and West 1987).
const ALIKE: usize = 3;

/// What the fitted flights say about a set of effects, and what all flights say together.
#[derive(Debug, Clone, Default)]
pub(crate) struct ErrorBars {
    /// Standard errors in the fitted flights, wider if the held-out flights disagree.
    pub(crate) errors: EffectSet,
    /// The mean over fitted and held-out flights, each weighted by its information.
    pub(crate) pooled: Estimates,
}

/// Error bars of the named effects.
pub(crate) fn error_bars(joint_fit: &JointFit<'_>, progress: &dyn Progress) -> ErrorBars {
    let Some((last, _)) = joint_fit.effects.last() else {
        return ErrorBars::default();
    };
    let Some(found) = joint_fit.followed(&joint_fit.effects, *last, progress) else {
        return ErrorBars::default();
    };
    let mut bars = error_bars_of(joint_fit, &found, progress);
    for ((effect, errors), (_, values)) in bars.errors.iter_mut().zip(&joint_fit.effects) {
        if effect.is_random() {
            let flights = joint_fit.flights();
            *errors = standard_errors(&flights, *effect, values).unwrap_or([0.0; PARAMETER_COUNT]);
        }
    }
    bars
}

/// The error bars of a candidate's effects.
fn error_bars_of(
    joint_fit: &JointFit<'_>,
    hypothesis: &Hypothesis,
    progress: &dyn Progress,
) -> ErrorBars {
    let lasting = lasting(joint_fit, hypothesis, progress);
    let apart = apart(joint_fit, hypothesis, progress);
    let both = lasting.iter().enumerate();
    let wider: Vec<f64> = both
        .map(|(k, lasting)| {
            let own = hypothesis.covariance[(k, k)];
            let birge = apart
                .iter()
                .map(|there| there.step[k].powi(2) / ((own + there.covariance[(k, k)]) * lasting));
            let birge = birge.sum::<f64>() / apart.len().max(1) as f64;
            lasting.sqrt() * birge.sqrt().max(1.0)
        })
        .collect();
    ErrorBars {
        errors: hypothesis.standard_errors(&wider),
        pooled: pooled(hypothesis, &lasting, &apart),
    }
}

/// Factor by which the variance of each parameter exceeds that for independent stretches; at least one.
fn lasting(joint_fit: &JointFit<'_>, hypothesis: &Hypothesis, progress: &dyn Progress) -> Vec<f64> {
    let effects = &hypothesis.effects;
    let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
    let (mut alone, mut lasting) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
    for (problem, fitted) in joint_fit.fitted.iter().chain(&joint_fit.held_out) {
        let Some(pulls) = pulls(problem, fitted, effects, &parameters, progress) else {
            continue;
        };
        let moves: Vec<DVector<f64>> = pulls
            .iter()
            .map(|pull| &hypothesis.covariance * pull)
            .collect();
        let mean = moves.iter().sum::<DVector<f64>>() / moves.len().max(1) as f64;
        for k in 0..parameters.len() {
            let at = |s: usize| moves[s][k] - mean[k];
            let both = |lag: usize| (lag..moves.len()).map(|s| at(s) * at(s - lag)).sum::<f64>();
            alone[k] += both(0);
            lasting[k] += both(0);
            for lag in 1..ALIKE {
                lasting[k] += 2.0 * (1.0 - lag as f64 / ALIKE as f64) * both(lag);
            }
        }
    }
    let each = lasting.iter().zip(&alone);
    each.map(|(lasting, alone)| {
        if *alone > 0.0 {
            (lasting / alone).max(1.0)
        } else {
            1.0
        }
    })
    .collect()
}

/// The step from a candidate's parameters to those that fit each held-out flight.
fn apart(joint_fit: &JointFit<'_>, hypothesis: &Hypothesis, progress: &dyn Progress) -> Vec<Step> {
    let effects = &hypothesis.effects;
    let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
    let prior = JointFit::prior(effects);
    let each = joint_fit.held_out.iter();
    each.filter_map(|flight| {
        let there = joint_fit.around(&[flight], effects, &parameters, progress)?;
        let (step, covariance) = there.solved(&prior, &JointFit::from_neutral(effects))?;
        Some(Step { step, covariance })
    })
    .collect()
}

/// A change of parameters and its covariance.
struct Step {
    step: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// The mean of the estimates from all flights, with a standard error that is wider if they disagree (Birge ratio).
/// `lasting` are factors on all variances.
fn pooled(hypothesis: &Hypothesis, lasting: &[f64], apart: &[Step]) -> Estimates {
    let parameters = lasting.len();
    let (mut steps, mut wider) = (DVector::zeros(parameters), vec![1.0; parameters]);
    for k in 0..parameters {
        let own = hypothesis.covariance[(k, k)];
        let others = apart
            .iter()
            .map(|there| (there.step[k], there.covariance[(k, k)]));
        let all: Vec<(f64, f64)> = core::iter::once((0.0, own)).chain(others).collect();
        let information: f64 = all.iter().map(|(_, variance)| 1.0 / variance).sum();
        let mean = all
            .iter()
            .map(|(step, variance)| step / variance)
            .sum::<f64>()
            / information;
        let squares = all
            .iter()
            .map(|(step, variance)| (step - mean).powi(2) / variance);
        let freedom = (all.len() - 1).max(1) as f64;
        let birge = squares.sum::<f64>() / (freedom * lasting[k]);
        steps[k] = mean;
        wider[k] = (lasting[k] * birge.max(1.0) / (information * own)).sqrt();
    }
    Estimates {
        effects: moved(&hypothesis.effects, &steps),
        errors: hypothesis.standard_errors(&wider),
    }
}

/// Slope of the log-likelihood in some parameters for each stretch, with the constants marginalized out.
fn pulls(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    effects: &EffectSet,
    parameters: &[ParameterId],
    progress: &dyn Progress,
) -> Option<Vec<DVector<f64>>> {
    let columns = problem.columns_around(fitted, effects, parameters, progress)?;
    let left = fitted.without_constants(&columns)?;
    let last = parameters.len();
    let pull = |left: &DMatrix<f64>| left.columns(0, last).tr_mul(&left.column(last));
    Some(left.iter().map(pull).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::effect::Effect;

    /// The mean and its standard error if a held-out flight prefers an updraft that is `step` higher than 2 +- 1 m/s.
    fn with_a_flight_that_is(step: f64) -> (f64, f64) {
        let hypothesis = Hypothesis {
            effect: Effect::Updraft,
            effects: vec![(Effect::Updraft, [2.0, 0.0, 0.0])],
            covariance: DMatrix::from_element(1, 1, 1.0),
            gain: 2.0,
            gains_held_out: vec![2.0],
        };
        let apart = Step {
            step: DVector::from_element(1, step),
            covariance: DMatrix::from_element(1, 1, 1.0),
        };
        let pooled = pooled(&hypothesis, &[1.0], &[apart]);
        (pooled.effects[0].1[0], pooled.errors[0].1[0])
    }

    #[test]
    fn flights_that_disagree_have_a_wider_mean() {
        let (mean, error) = with_a_flight_that_is(0.0);
        assert!((mean - 2.0).abs() < 1e-12 && (error - 0.5_f64.sqrt()).abs() < 1e-12);
        let (mean, error) = with_a_flight_that_is(4.0);
        assert!((mean - 4.0).abs() < 1e-12 && (error - 2.0).abs() < 1e-12);
        let (mean, error) = with_a_flight_that_is(-4.0);
        assert!(mean.abs() < 1e-12 && (error - 2.0).abs() < 1e-12);
    }
}
