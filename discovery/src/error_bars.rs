//! Factors by which the standard errors of an effect exceed those of the linear problem.
//!
//! The joint wander is modelled as independent in every stretch but persists for seconds, so neighbouring stretches
//! bias an effect alike. The linear problem also cannot see its own errors, but held-out flights reveal them.

use nalgebra::{DMatrix, DVector};

use super::candidate::Candidate;
use super::contest::Scene;
use super::effect_set::{EffectSet, ParameterId, moved, parameters_of};
use super::fitted::Fitted;
use super::problem::Problem;
use super::progress::Progress;

/// Number of neighbouring stretches whose influence may be correlated (Newey and West 1987).
const ALIKE: usize = 3;

/// Effects with the standard errors of their parameters.
#[derive(Debug, Clone, Default)]
pub(super) struct Estimates {
    pub(super) effects: EffectSet,
    pub(super) errors: EffectSet,
}

/// What the fitted flights say about a set of effects, and what all flights say together.
#[derive(Debug, Clone, Default)]
pub(super) struct ErrorBars {
    /// Standard errors in the fitted flights, wider if the held-out flights disagree.
    pub(super) errors: EffectSet,
    /// The mean over fitted and held-out flights, each weighted by its information.
    pub(super) pooled: Estimates,
}

impl Scene<'_> {
    /// The error bars of a candidate's effects.
    pub(super) fn error_bars(&self, candidate: &Candidate, progress: &dyn Progress) -> ErrorBars {
        let lasting = self.lasting(candidate, progress);
        let apart = self.apart(candidate, progress);
        let both = lasting.iter().enumerate();
        let wider: Vec<f64> = both
            .map(|(k, lasting)| {
                let own = candidate.covariance[(k, k)];
                let birge = apart.iter().map(|there| {
                    there.step[k].powi(2) / ((own + there.covariance[(k, k)]) * lasting)
                });
                let birge = birge.sum::<f64>() / apart.len().max(1) as f64;
                lasting.sqrt() * birge.sqrt().max(1.0)
            })
            .collect();
        ErrorBars {
            errors: candidate.standard_errors(&wider),
            pooled: pooled(candidate, &lasting, &apart),
        }
    }

    /// Factor by which the variance of each parameter exceeds that for independent stretches; at least one.
    fn lasting(&self, candidate: &Candidate, progress: &dyn Progress) -> Vec<f64> {
        let effects = &candidate.effects;
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        let (mut alone, mut lasting) = (vec![0.0; parameters.len()], vec![0.0; parameters.len()]);
        for (problem, fitted) in self.fitted.iter().chain(&self.held_out) {
            let Some(pulls) = problem.pulls(fitted, effects, &parameters, progress) else {
                continue;
            };
            let moves: Vec<DVector<f64>> = pulls
                .iter()
                .map(|pull| &candidate.covariance * pull)
                .collect();
            let mean = moves.iter().sum::<DVector<f64>>() / moves.len().max(1) as f64;
            for k in 0..parameters.len() {
                let at = |s: usize| moves[s][k] - mean[k];
                let both =
                    |lag: usize| (lag..moves.len()).map(|s| at(s) * at(s - lag)).sum::<f64>();
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
    fn apart(&self, candidate: &Candidate, progress: &dyn Progress) -> Vec<Step> {
        let effects = &candidate.effects;
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        let prior = Self::prior(effects);
        let each = self.held_out.iter();
        each.filter_map(|flight| {
            let there = self.around(&[flight], effects, &parameters, progress)?;
            let (step, covariance) = there.solved(&prior, &Self::from_neutral(effects))?;
            Some(Step { step, covariance })
        })
        .collect()
    }
}

/// A change of parameters and its covariance.
struct Step {
    step: DVector<f64>,
    covariance: DMatrix<f64>,
}

/// The mean of the estimates from all flights, with a standard error that is wider if they disagree (Birge ratio).
/// `lasting` are factors on all variances.
fn pooled(candidate: &Candidate, lasting: &[f64], apart: &[Step]) -> Estimates {
    let parameters = lasting.len();
    let (mut steps, mut wider) = (DVector::zeros(parameters), vec![1.0; parameters]);
    for k in 0..parameters {
        let own = candidate.covariance[(k, k)];
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
        effects: moved(&candidate.effects, &steps),
        errors: candidate.standard_errors(&wider),
    }
}

impl Problem<'_> {
    /// Slope of the log-likelihood in some parameters for each stretch, with the constants marginalized out.
    fn pulls(
        &self,
        fitted: &Fitted,
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<Vec<DVector<f64>>> {
        let columns = self.columns_around(fitted, effects, parameters, progress)?;
        let left = fitted.without_constants(&columns)?;
        let last = parameters.len();
        let pull = |left: &DMatrix<f64>| left.columns(0, last).tr_mul(&left.column(last));
        Some(left.iter().map(pull).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::effect::Effect;

    /// The mean and its standard error if a held-out flight prefers an updraft that is `step` higher than 2 +- 1 m/s.
    fn with_a_flight_that_is(step: f64) -> (f64, f64) {
        let candidate = Candidate {
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
        let pooled = pooled(&candidate, &[1.0], &[apart]);
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
