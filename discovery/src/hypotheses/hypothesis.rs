//! An effect fitted in addition to those already named: what it gains, and whether that is enough.

use crate::named_effect::{EffectSet, Rival};
use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use bodyflight_falls::statistics::{quantile_of_sorted, z_score};
use nalgebra::DMatrix;

use crate::hypotheses::decision::DECISION;
use crate::jacobian::effect_parameters::{freedom, parameters_of};

/// An effect fitted in addition to those named.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis {
    /// The effect.
    pub effect: Effect,
    /// All effects, this one included.
    pub effects: EffectSet,
    /// Covariance of all their parameters.
    pub covariance: DMatrix<f64>,
    /// Gain of log-likelihood in the fitted flights.
    pub gain: f64,
    /// Gain in each held-out flight.
    pub gains_held_out: Vec<f64>,
}

impl Hypothesis {
    /// Gain in all flights, less the cost of the parameters.
    pub(crate) fn total(&self) -> f64 {
        self.gain + self.gains_held_out.iter().sum::<f64>()
            - DECISION.gain_per_parameter * freedom(self.effect)
    }

    /// Gain to expect in all flights once everything is refitted, which limits the loss of a held-out flight.
    pub(crate) fn penalized_gain(&self) -> f64 {
        let held_out = self.gains_held_out.iter();
        let held_out: f64 = held_out
            .map(|gain| gain.max(-DECISION.held_out_loss * self.gain))
            .sum();
        self.gain + held_out - DECISION.gain_per_parameter * freedom(self.effect)
    }

    /// Significance of its gain, in standard deviations.
    pub(crate) fn z_score(&self) -> f64 {
        z_score(2.0 * self.gain.max(0.0), freedom(self.effect))
    }

    /// Significance of the gain in all flights together. Held-out flights did not take part in the fit and so lose by
    /// chance; a gain far beyond that of the fitted flights is not counted.
    pub(crate) fn z_score_together(&self) -> f64 {
        let held_out = self.gains_held_out.iter();
        let most = DECISION.confirming_ratio * self.gain;
        let gain = self.gain + held_out.map(|gain| gain.min(most)).sum::<f64>();
        z_score(2.0 * gain.max(0.0), freedom(self.effect))
    }

    /// Whether it is better than `best` after everything was refitted. Of two that are equally good, the first in the
    /// library is named.
    pub(crate) fn replaces(&self, best: &Self) -> bool {
        let is_equal = within(DECISION.equal_gain, best.total(), self.total());
        let is_second = is_equal && best.effect < self.effect;
        self.total() > best.total() + DECISION.replacing_gain && !is_second
    }

    /// Parameters of this effect.
    pub(crate) fn values(&self) -> [f64; PARAMETER_COUNT] {
        let own = self
            .effects
            .iter()
            .find(|(effect, _)| *effect == self.effect);
        own.map_or_else(|| self.effect.neutral(), |(_, values)| *values)
    }

    /// Standard errors of all effects: those of the linear problem times a factor for each parameter, one if missing.
    pub(crate) fn standard_errors(&self, wider: &[f64]) -> EffectSet {
        let parameters = parameters_of(self.effects.iter().map(|(effect, _)| *effect));
        let of = |effect: Effect| {
            let mut errors = [0.0; PARAMETER_COUNT];
            let own = parameters.iter().enumerate();
            for (k, id) in own.filter(|(_, id)| id.effect == effect) {
                let wider = wider.get(k).copied().unwrap_or(1.0);
                errors[id.index] = self.covariance[(k, k)].sqrt() * wider;
            }
            (effect, errors)
        };
        self.effects.iter().map(|(effect, _)| of(*effect)).collect()
    }

    /// All effects, with the strength of this one multiplied by `share`.
    pub(crate) fn stretched(&self, share: f64) -> EffectSet {
        let mut effects = self.effects.clone();
        for (effect, values) in &mut effects {
            if *effect == self.effect {
                for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
                    let far = parameter.neutral + share * (*value - parameter.neutral);
                    *value = far.clamp(parameter.low, parameter.high);
                }
            }
        }
        effects
    }

    /// Whether the effect is strong enough to matter.
    pub(crate) fn matters(&self) -> bool {
        let parameters = self.effect.description().parameters;
        parameters
            .iter()
            .zip(self.values())
            .any(|(parameter, value)| {
                parameter.share_of_range(value) > DECISION.material_share_of_range
            })
    }

    /// Whether the fitted flights alone cannot distinguish it from `best`.
    pub(crate) fn gains_as_much_as(&self, best: &Self) -> bool {
        within(DECISION.equal_gain, self.gain, best.gain)
    }

    /// Whether it is indistinguishable from `best`.
    pub(crate) fn is_rival_of(&self, best: &Self) -> bool {
        within(DECISION.rival_gain, self.total(), best.total())
    }

    /// As a rival of `best`, which gains about as much.
    pub(crate) fn as_rival_of(&self, best: &Self) -> Rival {
        Rival {
            name: self.effect.description().name,
            share: self.total() / best.total(),
        }
    }
}

/// Whether a gain is less than the best one by at most `margin`, or by the share within which effects are equally good.
fn within(margin: f64, gain: f64, best: f64) -> bool {
    gain > best - margin.max(DECISION.equal_share * best)
}

/// A named effect.
pub(crate) struct NamedEffect {
    pub(crate) hypothesis: Hypothesis,
    /// Share of random draws in which some effect gains as much.
    pub(crate) chance: f64,
    pub(crate) rivals: Vec<Rival>,
}

impl NamedEffect {
    /// Adds those of the rejected candidates as rivals that gain as much in the fitted flights: held-out flights alone
    /// speak against them.
    pub(crate) fn contest(&mut self, rejected: &[Hypothesis]) {
        let as_good = |other: &&Hypothesis| other.gains_as_much_as(&self.hypothesis);
        let rivals = rejected.iter().filter(as_good);
        let rivals = rivals.map(|other| other.as_rival_of(&self.hypothesis));
        self.rivals.extend(rivals);
    }
}

/// Probability that some effect of the library is as significant by chance, given sorted random draws.
pub(crate) fn by_chance(z_score: f64, draws: &[f64]) -> f64 {
    let above = draws.len() - draws.partition_point(|draw| *draw < z_score);
    (above + 1) as f64 / (draws.len() + 1) as f64
}

/// A candidate that was not named.
pub(crate) struct Rejected {
    pub(crate) name: NamedEffect,
    /// Standard errors of the effects fitted with it.
    pub(crate) errors: EffectSet,
    /// Whether it was significant before subject, coefficients and joints were adjusted, so that it may be the cause of
    /// these adjustments.
    pub(crate) is_alternative: bool,
}

/// The best candidate, and the candidates from which it was chosen.
pub(crate) struct BestHypothesis {
    pub(crate) name: NamedEffect,
    /// Best first.
    pub(crate) hypotheses: Vec<Hypothesis>,
    pub(crate) chance: Vec<f64>,
    /// Whether it was found around the files rather than around the flights' own constants.
    pub(crate) around_files: bool,
    pub(crate) is_promising: bool,
}

/// Whether a candidate gains enough to be named.
pub(crate) fn is_significant(hypothesis: &Hypothesis, chance: &[f64]) -> bool {
    let votes = hypothesis
        .gains_held_out
        .iter()
        .all(|gain| *gain > DECISION.held_out_gain);
    let beyond_chance = quantile_of_sorted(chance, DECISION.null_quantile);
    let least = if hypothesis.gains_held_out.is_empty() {
        DECISION.least_z_without_held_out
    } else {
        DECISION.least_z.max(beyond_chance + DECISION.z_beyond_null)
    };
    let gains =
        votes && hypothesis.z_score_together() > least && hypothesis.total() > DECISION.total_gain;
    gains && hypothesis.matters()
}

/// Effects with the standard errors of their parameters.
#[derive(Debug, Clone, Default)]
pub(crate) struct Estimates {
    pub(crate) effects: EffectSet,
    pub(crate) errors: EffectSet,
}

/// Whether the parameters of the last effect differ from neutral by more than their standard errors allow, which are
/// wider than the gain suggests if stretches or flights disagree. What the first effect leaves may look like another, so
/// further effects must be clear.
pub(crate) fn differs_from_neutral(all_flights: &Estimates, named: usize) -> bool {
    let Estimates { effects, errors } = all_flights;
    let (Some(effect), Some(errors)) = (effects.last(), errors.last()) else {
        return false;
    };
    differs(effect, errors, (named > 0).then_some(DECISION.least_z))
}

/// Whether a parameter of an effect differs from neutral by more than so many standard errors; by default, whether the
/// intervals of all its parameters exclude their neutral values.
pub(crate) fn differs(
    (effect, values): &(Effect, [f64; PARAMETER_COUNT]),
    (_, errors): &(Effect, [f64; PARAMETER_COUNT]),
    least: Option<f64>,
) -> bool {
    let parameters = effect.description().parameters;
    let interval = DECISION.intervals[parameters.len().clamp(1, DECISION.intervals.len()) - 1];
    let least = least.unwrap_or(interval);
    parameters
        .iter()
        .zip(values.iter().zip(errors))
        .any(|(parameter, (value, error))| (value - parameter.neutral).abs() > least * error)
}
