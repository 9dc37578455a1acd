//! An effect fitted in addition to those already named: what it gains, and whether that is enough.

use crate::named_effect::{EffectSet, Rival};
use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::{DMatrix, DVector};

use crate::hypotheses::decision::DECISION;
use crate::jacobian::effect_parameters::{ParameterId, estimated, parameters_of};

/// An effect fitted in addition to those named.
#[derive(Debug, Clone)]
pub(crate) struct Hypothesis {
    /// The effect.
    pub effect: Effect,
    /// All effects, this one included.
    pub effects: EffectSet,
    /// Covariance of all their parameters; of an effect that changes at random, of its strengths.
    pub covariance: DMatrix<f64>,
    /// Factor by which neighbouring stretches that err alike widen variances. The log-likelihood says as much less.
    pub tempering: f64,
    /// Gain of log-likelihood in the fitted flights.
    pub gain: f64,
    /// Gain in each held-out flight.
    pub gains_held_out: Vec<f64>,
    /// Gain in all flights with the slopes and the covariance of the flights without it, if that was computed.
    pub gain_without_refit: Option<f64>,
}

impl Hypothesis {
    /// Logarithm of the odds that this effect acts rather than none, given the fitted flights: the Bayes factor in
    /// Laplace's approximation, with the ranges of the parameters as priors and one prior probability for all effects
    /// of the library together. It chooses among effects.
    pub(crate) fn score(&self) -> f64 {
        self.gain + self.cost_of_ranges(1.0)
    }

    /// Whether it is worth refitting everything with it: it is more likely than none. The threshold is lower than for a
    /// name, because errors fitted without the effect may have absorbed part of it.
    pub(crate) fn is_promising(&self) -> bool {
        self.score() > 0.0
    }

    /// The same as the score given all flights, tempered. It decides whether the effect is named.
    ///
    /// A held-out flight adds its gain with parameters that were not fitted to it, which is its factor in the probability
    /// of all flights. What the errors of refits give away is subtracted. If the gain without a refit is known, which has no
    /// such errors, the lesser of both gains counts without this subtraction, if that is more.
    pub(crate) fn log_odds(&self) -> f64 {
        let gain = self.whole_gain();
        let sure = gain - self.tempering * DECISION.refit_allowance();
        let without_refit = self.gain_without_refit.map(|other| other.min(gain));
        self.odds_by(without_refit.map_or(sure, |other| other.max(sure)))
    }

    /// Takes from its gains what the flights without it have gained since, the held-out ones last.
    pub(crate) fn less_likely(&mut self, gained: &[f64]) {
        let (fitted, held_out) = gained.split_at(gained.len() - self.gains_held_out.len());
        self.gain -= fitted.iter().sum::<f64>();
        for (gain, gained) in self.gains_held_out.iter_mut().zip(held_out) {
            *gain -= gained;
        }
    }

    /// Gain in all flights.
    pub(crate) fn whole_gain(&self) -> f64 {
        self.gain + self.gains_held_out.iter().sum::<f64>()
    }

    /// Log odds if the gain in all flights were this.
    fn odds_by(&self, gain: f64) -> f64 {
        gain / self.tempering + self.cost_of_ranges(self.tempering)
    }

    /// Whether it would be certain enough to be named if refits had no errors, but is not.
    pub(crate) fn hinges_on_refits(&self) -> bool {
        let certain = DECISION.certain_odds();
        self.log_odds() < certain && self.odds_by(self.whole_gain()) > certain
    }

    /// Probability that the effect does not act: the local false discovery rate.
    pub(crate) fn false_discovery_rate(&self) -> f64 {
        1.0 / (1.0 + self.log_odds().exp())
    }

    /// What the library and the ranges of the parameters cost, as a negative gain: the wider a range, the less likely was
    /// any value in it.
    fn cost_of_ranges(&self, tempering: f64) -> f64 {
        let parameters = estimated(self.effect).iter().zip(self.values());
        let each = parameters.enumerate().map(|(index, (parameter, value))| {
            let effect = self.effect;
            let deviation = ParameterId { effect, index }.prior_deviation();
            let away = (value - parameter.neutral) / deviation;
            deviation.ln() + 0.5 * away * away
        });
        let determinant = (self.own_covariance() * tempering).determinant();
        0.5 * determinant.max(f64::MIN_POSITIVE).ln()
            - each.sum::<f64>()
            - (Effect::ALL.len() as f64).ln()
    }

    /// Covariance of the parameters of this effect.
    fn own_covariance(&self) -> DMatrix<f64> {
        if self.effect.is_random() {
            return self.covariance.clone();
        }
        let parameters = parameters_of(self.effects.iter().map(|(effect, _)| *effect));
        let own = parameters.iter().enumerate();
        let own: Vec<usize> = own
            .filter(|(_, id)| id.effect == self.effect)
            .map(|(k, _)| k)
            .collect();
        self.covariance.select_rows(&own).select_columns(&own)
    }

    /// Another of the effects beside the rest: its gain is that over its neutral values, to second order.
    pub(crate) fn of_effect(&self, effect: Effect) -> Self {
        let mut own = Self {
            effect,
            gains_held_out: Vec::new(),
            gain_without_refit: None,
            ..self.clone()
        };
        let away: Vec<f64> = estimated(effect)
            .iter()
            .zip(own.values())
            .map(|(parameter, value)| value - parameter.neutral)
            .collect();
        let away = DVector::from_vec(away);
        let solved = own.own_covariance().cholesky();
        own.gain = solved.map_or(0.0, |factor| 0.5 * away.dot(&factor.solve(&away)));
        own
    }

    /// Difference of log-likelihood that says nothing.
    fn refit_noise(&self) -> f64 {
        DECISION
            .refit_noise
            .max(DECISION.refit_noise_share * self.gain)
    }

    /// Whether it is better than `best` after everything was refitted. Of two that are the same in a recording, the first in
    /// the library is named.
    pub(crate) fn replaces(&self, best: &Self) -> bool {
        let least = if best.effect < self.effect && are_same(best.effect, self.effect) {
            best.refit_noise()
        } else {
            0.0
        };
        self.score() > best.score() + least
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
}

/// A named effect.
#[derive(Clone)]
pub(crate) struct NamedEffect {
    pub(crate) hypothesis: Hypothesis,
    /// Other effects that were refitted and not named.
    pub(crate) others: Vec<Hypothesis>,
}

impl NamedEffect {
    /// Takes from the gains of the others what the flights without any of them have gained since.
    pub(crate) fn less_likely(&mut self, gained: &[f64]) {
        for other in &mut self.others {
            other.less_likely(gained);
        }
    }

    /// Whether it is more likely than its rivals together. Where it is not, that one of them acts may be certain, but not
    /// which.
    pub(crate) fn is_likeliest(&self) -> bool {
        let shares = self.shares().into_iter();
        let others = shares.filter(|(other, _)| !are_same(*other, self.hypothesis.effect));
        others.map(|(_, share)| share).sum::<f64>() < DECISION.rivals_share
    }

    /// The effects that may act instead, each with its probability, if that is not negligible.
    pub(crate) fn rivals(&self) -> Vec<Rival> {
        let rivals = self.shares().into_iter().map(|(effect, share)| Rival {
            name: effect.description().name,
            share,
        });
        rivals
            .filter(|rival| rival.share > DECISION.false_discovery_rate)
            .collect()
    }

    /// The other effects, each with the probability that it acts given that this or one of the others does; the most likely
    /// first.
    ///
    /// Scores count only as far as they differ by more than fits of the same flights do.
    fn shares(&self) -> Vec<(Effect, f64)> {
        let best = &self.hypothesis;
        let odds = |other: &Hypothesis| ((other.score() - best.score()) / best.refit_noise()).exp();
        let others = self
            .others
            .iter()
            .filter(|other| other.effect != best.effect);
        let mut each: Vec<(Effect, f64)> =
            others.map(|other| (other.effect, odds(other))).collect();
        // An effect may have been refitted twice.
        each.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.total_cmp(&a.1)));
        each.dedup_by_key(|(effect, _)| *effect);
        each.sort_by(|a, b| b.1.total_cmp(&a.1));
        let all = 1.0 + each.iter().map(|(_, odds)| odds).sum::<f64>();
        each.into_iter()
            .map(|(effect, odds)| (effect, odds / all))
            .collect()
    }
}

/// A candidate that was not named.
pub(crate) struct Rejected {
    pub(crate) name: NamedEffect,
    /// Standard errors of the effects fitted with it.
    pub(crate) errors: EffectSet,
    /// Whether it was promising before subject, coefficients and joints were adjusted, so that it may be the cause of
    /// these adjustments.
    pub(crate) is_alternative: bool,
}

/// The best candidate, and the candidates from which it was chosen.
pub(crate) struct BestHypothesis {
    pub(crate) hypothesis: Hypothesis,
    /// Best first.
    pub(crate) hypotheses: Vec<Hypothesis>,
    /// Whether it was found around the files rather than around the flights' own constants.
    pub(crate) around_files: bool,
}

/// Whether two effects are the same in a recording: the speed of the aircraft is a wind that blows from the exit on.
fn are_same(one: Effect, other: Effect) -> bool {
    const SAME: [Effect; 2] = [Effect::Wind, Effect::ExitSpeed];
    one == other || (SAME.contains(&one) && SAME.contains(&other))
}

/// Whether a candidate is certain enough to be named, and strong enough to matter. Neither the fitted nor the held-out
/// flights alone may speak against it.
pub(crate) fn is_significant(hypothesis: &Hypothesis) -> bool {
    let held_out: f64 = hypothesis.gains_held_out.iter().sum();
    hypothesis.false_discovery_rate() < DECISION.false_discovery_rate
        && hypothesis.is_promising()
        && held_out >= 0.0
        && hypothesis.matters()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An updraft with a normal estimate, fitted together with its prior.
    fn updraft(estimate: f64, error: f64) -> Hypothesis {
        let effect = Effect::Updraft;
        let prior = ParameterId { effect, index: 0 }.prior_deviation();
        let variance = 1.0 / (error.powi(-2) + prior.powi(-2));
        let value = variance * estimate / error.powi(2);
        let left = |value: f64| 0.5 * ((estimate - value) / error).powi(2);
        Hypothesis {
            effect,
            effects: vec![(effect, [value, 0.0, 0.0])],
            covariance: DMatrix::from_element(1, 1, variance),
            tempering: 1.0,
            gain: left(0.0) - left(value),
            gains_held_out: Vec::new(),
            gain_without_refit: None,
        }
    }

    /// In a linear problem with normal errors, Laplace's approximation is exact: the probability of the estimate with a
    /// strength drawn from the range, over that without any.
    #[test]
    fn the_score_is_the_ratio_of_two_normal_densities() {
        let effect = Effect::Updraft;
        let prior = ParameterId { effect, index: 0 }.prior_deviation();
        for (estimate, error) in [(0.0, 0.1), (1.0, 0.3), (2.0, 4.0)] {
            let density =
                |deviation: f64| -deviation.ln() - 0.5 * f64::powi(estimate / deviation, 2);
            let factor = density(prior.hypot(error)) - density(error);
            let expected = factor - (Effect::ALL.len() as f64).ln();
            let found = updraft(estimate, error).score();
            assert!(
                (found - expected).abs() < 1e-9,
                "{found}, expected {expected}"
            );
        }
    }

    #[test]
    fn held_out_flights_and_neighbours_that_err_alike_change_the_odds() {
        let sure = updraft(4.0, 0.5);
        assert!(is_significant(&sure), "{}", sure.log_odds());
        let refuted = Hypothesis {
            gains_held_out: vec![-20.0],
            ..sure.clone()
        };
        let tempered = Hypothesis {
            tempering: 2.0,
            ..sure.clone()
        };
        for other in [refuted, tempered] {
            assert!(!is_significant(&other), "{}", other.log_odds());
            // They only judge what was chosen without them.
            assert!((other.score() - sure.score()).abs() < 1e-12);
        }
    }

    /// A gain that two computations agree on needs no allowance; where they differ, the lesser or the allowance counts.
    #[test]
    fn without_refits_there_is_no_error_of_refits() {
        let unsure = updraft(3.0, 0.5);
        assert!(unsure.hinges_on_refits() && !is_significant(&unsure));
        let odds = |gain: f64| {
            let checked = Hypothesis {
                gain_without_refit: Some(gain),
                ..unsure.clone()
            };
            checked.log_odds()
        };
        let most = unsure.log_odds() + DECISION.refit_allowance();
        for (gain, expected) in [
            (2.0 * unsure.gain, most),
            (unsure.gain, most),
            (unsure.gain - 1.0, most - 1.0),
            (-100.0, unsure.log_odds()),
        ] {
            assert!((odds(gain) - expected).abs() < 1e-9, "{gain}");
        }
        assert!(!updraft(0.1, 0.5).hinges_on_refits());
        assert!(!updraft(8.0, 0.5).hinges_on_refits());
    }

    /// Beside nothing else, the gain over neutral values is the one that the fit found.
    #[test]
    fn an_effect_among_others_gains_what_it_would_alone() {
        let alone = updraft(4.0, 0.01);
        let mut both = alone.clone();
        both.effects
            .push((Effect::Booties, Effect::Booties.neutral()));
        both.effect = Effect::Booties;
        both.covariance =
            DMatrix::from_diagonal(&DVector::from_vec(vec![alone.covariance[(0, 0)], 1.0]));
        let own = both.of_effect(Effect::Updraft);
        assert!((own.score() / alone.score() - 1.0).abs() < 1e-3);
        assert!(!is_significant(&both.of_effect(Effect::Booties)));
    }

    /// Rivals are compared with the same flights: what these gain without any effect, each rival gains less.
    #[test]
    fn what_flights_gain_without_an_effect_every_rival_gains_less() {
        let hypothesis = updraft(4.0, 0.5);
        let rival = Hypothesis {
            gain: 30.0,
            gains_held_out: vec![20.0, 10.0],
            ..hypothesis.clone()
        };
        let mut name = NamedEffect {
            others: vec![rival],
            hypothesis: hypothesis.clone(),
        };
        name.less_likely(&[5.0, 1.0, 2.0, 3.0]);
        let [rival] = &name.others[..] else {
            panic!("one rival");
        };
        assert_eq!(
            (rival.gain, &rival.gains_held_out[..]),
            (24.0, &[18.0, 7.0][..])
        );
        assert!((name.hypothesis.gain - hypothesis.gain).abs() < 1e-12);
    }

    /// Another effect with a score that is lower by this.
    fn beside(best: &Hypothesis, effect: Effect, less: f64) -> Hypothesis {
        let mut other = Hypothesis {
            effect,
            effects: vec![(effect, best.effects[0].1)],
            ..best.clone()
        };
        other.gain += best.score() - other.score() - less;
        other
    }

    #[test]
    fn rivals_have_the_probability_that_their_scores_give_them() {
        let hypothesis = updraft(4.0, 0.5);
        let close = beside(&hypothesis, Effect::Booties, 0.0);
        let far = beside(&hypothesis, Effect::Arch, 100.0);
        let name = NamedEffect {
            others: vec![far, close],
            hypothesis,
        };
        let [rival] = &name.rivals()[..] else {
            panic!("one rival");
        };
        assert_eq!(rival.name, "booties");
        assert!((rival.share - 0.5).abs() < 1e-6, "{}", rival.share);
    }

    /// The better of two is named, if it is more likely than all others together. What is the same in a recording is none of
    /// them.
    #[test]
    fn a_tie_has_no_name() {
        let best = updraft(4.0, 0.5);
        let is_likeliest = |others: &[Hypothesis]| {
            let name = NamedEffect {
                hypothesis: best.clone(),
                others: others.to_vec(),
            };
            name.is_likeliest()
        };
        let [close, far] = [1.0, 20.0].map(|less| beside(&best, Effect::Booties, less));
        let third = beside(&best, Effect::Arch, 1.0);
        assert!(best.replaces(&close));
        assert!(is_likeliest(core::slice::from_ref(&close)));
        assert!(!is_likeliest(&[close, third]));
        assert!(is_likeliest(&[far, beside(&best, Effect::Arch, 20.0)]));
        assert!(are_same(Effect::Wind, Effect::ExitSpeed) && !are_same(Effect::Wind, Effect::Lift));
    }

    /// Much that is gained in one part of the flights does not make up for what is lost in the other.
    #[test]
    fn fitted_and_held_out_flights_must_agree() {
        let told = Hypothesis {
            gains_held_out: vec![40.0],
            ..updraft(4.0, 0.5)
        };
        assert!(is_significant(&told));
        let untold = Hypothesis {
            gain: told.gain - told.score() - 0.1,
            ..told.clone()
        };
        let refuted = Hypothesis {
            gain: told.gain + 40.0,
            gains_held_out: vec![-1.0],
            ..told
        };
        for one in [untold, refuted] {
            assert!(one.log_odds() > 4.0 && !is_significant(&one));
        }
    }
}
