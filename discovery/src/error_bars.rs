//! Factors by which the standard errors of an effect exceed those of the linear problem.
//!
//! The joint wander is modelled as independent in every stretch but persists for seconds, so neighbouring stretches
//! bias an effect alike. The linear problem also cannot see its own errors, but held-out flights reveal them.

use nalgebra::{DMatrix, DVector};

use super::candidate::Candidate;
use super::contest::Scene;
use super::effect_set::{EffectSet, ParameterId, parameters_of};
use super::fitted::Fitted;
use super::problem::Problem;
use super::progress::Progress;

/// Number of neighbouring stretches whose influence may be correlated (Newey and West 1987).
const ALIKE: usize = 3;

impl Scene<'_> {
    /// Factors on the standard errors of a candidate's parameters, at least one.
    pub fn wider(&self, candidate: &Candidate, progress: &dyn Progress) -> Vec<f64> {
        let lasting = self.lasting(candidate, progress);
        let apart = self.apart(candidate, &lasting, progress);
        let both = lasting.iter().zip(apart);
        both.map(|(lasting, apart)| lasting.sqrt() * apart)
            .collect()
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

    /// Deviation of held-out flights from a candidate's parameters, in the combined standard errors of both estimates;
    /// at least one (Birge ratio).
    fn apart(&self, candidate: &Candidate, lasting: &[f64], progress: &dyn Progress) -> Vec<f64> {
        let effects = &candidate.effects;
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        let prior = Self::prior(effects);
        let mut squares = vec![0.0; parameters.len()];
        for flight in &self.held_out {
            let there = self.around(&[flight], effects, &parameters, progress);
            let Some((step, covariance)) =
                there.and_then(|there| there.solved(&prior, &Self::from_neutral(effects)))
            else {
                continue;
            };
            for (k, square) in squares.iter_mut().enumerate() {
                let variance = covariance[(k, k)] + candidate.covariance[(k, k)];
                *square += step[k] * step[k] / (variance * lasting[k]);
            }
        }
        let count = self.held_out.len().max(1) as f64;
        squares
            .iter()
            .map(|square| (square / count).sqrt().max(1.0))
            .collect()
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
