//! Factors by which the standard errors of an effect exceed those of the linear problem.
//!
//! The joint wander is modelled as independent in every stretch but persists for seconds, so neighbouring stretches
//! bias an effect alike. The linear problem also cannot see its own errors, but held-out flights reveal them.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::PARAMETER_COUNT;
use nalgebra::{DMatrix, DVector};

use crate::hypotheses::hypothesis::{Hypothesis, is_significant};
use crate::hypotheses::score_test::JointFit;
use crate::jacobian::effect_parameters::{ParameterId, parameters_of};
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::random_effect_fit::standard_errors;
use crate::progress::Progress;

/// Number of neighbouring stretches whose influence may be correlated (Newey and West 1987).
const ALIKE: usize = 3;

/// What the fitted flights say about a set of effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct ErrorBars {
    /// Standard errors, wider if the held-out flights disagree.
    pub(crate) errors: EffectSet,
    /// The last of the effects, with the covariance around the fit.
    last: Option<Hypothesis>,
    /// Factor by which the variance of each parameter exceeds that for independent stretches.
    lasting: Vec<f64>,
}

impl ErrorBars {
    /// An effect with the covariance around the fit, tempered. Its gains stay those of the refitted flights.
    pub(crate) fn judged(&self, hypothesis: Hypothesis) -> Hypothesis {
        let Some(last) = &self.last else {
            return hypothesis;
        };
        let parameters = parameters_of(last.effects.iter().map(|(effect, _)| *effect));
        let own = parameters.iter().zip(&self.lasting);
        let own = own.filter(|(id, _)| id.effect == hypothesis.effect);
        let own: Vec<f64> = own.map(|(_, lasting)| *lasting).collect();
        Hypothesis {
            covariance: last.covariance.clone(),
            tempering: own.iter().sum::<f64>().max(1.0) / own.len().max(1) as f64,
            ..hypothesis
        }
    }

    /// Standard errors of the effects, or those of the first-order estimate if there are no better ones.
    pub(crate) fn errors_beside(self, hypothesis: &Hypothesis) -> EffectSet {
        if self.errors.is_empty() {
            hypothesis.standard_errors(&[])
        } else {
            self.errors
        }
    }

    /// The first of the effects, apart from the last, that is not certain beside the others.
    pub(crate) fn redundant(&self) -> Option<Hypothesis> {
        let last = self.last.as_ref()?;
        let (_, earlier) = last.effects.split_last()?;
        let mut each = earlier
            .iter()
            .map(|(effect, _)| self.judged(last.of_effect(*effect)));
        each.find(|one| !is_significant(one))
    }
}

/// Error bars of the named effects.
pub(crate) fn error_bars(joint_fit: &JointFit<'_>, progress: &dyn Progress) -> ErrorBars {
    let Some((last, _)) = joint_fit.effects.last() else {
        return ErrorBars::default();
    };
    let Some(found) = joint_fit.followed(&joint_fit.effects, *last, progress) else {
        return ErrorBars::default();
    };
    let lasting = lasting(joint_fit, &found, progress);
    let mut errors = found.standard_errors(&wider(joint_fit, &found, &lasting, progress));
    for ((effect, errors), (_, values)) in errors.iter_mut().zip(&joint_fit.effects) {
        if effect.is_random() {
            let flights = joint_fit.flights();
            *errors = standard_errors(&flights, *effect, values).unwrap_or([0.0; PARAMETER_COUNT]);
        }
    }
    ErrorBars {
        errors,
        last: Some(found),
        lasting,
    }
}

/// Factor on the standard error of each parameter: neighbouring stretches that err alike, and held-out flights that prefer
/// another value (Birge ratio).
fn wider(
    joint_fit: &JointFit<'_>,
    hypothesis: &Hypothesis,
    lasting: &[f64],
    progress: &dyn Progress,
) -> Vec<f64> {
    let apart = apart(joint_fit, hypothesis, progress);
    let both = lasting.iter().enumerate();
    both.map(|(k, lasting)| {
        let own = hypothesis.covariance[(k, k)];
        let birge = apart
            .iter()
            .map(|there| there.step[k].powi(2) / ((own + there.covariance[(k, k)]) * lasting));
        let birge = birge.sum::<f64>() / apart.len().max(1) as f64;
        lasting.sqrt() * birge.sqrt().max(1.0)
    })
    .collect()
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
