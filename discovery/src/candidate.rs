//! An effect fitted in addition to those already named: what it gains, and whether that is enough.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::DMatrix;

use super::effect_set::{EffectSet, freedom, parameters_of};
use super::statistics::deviations;

/// Gain that each parameter costs (Schwarz criterion for a few hundred independent observations).
pub const COST: f64 = 3.0;

/// An effect is as good as the best if its gain is within this difference, or within this share of the best gain.
const EQUAL: f64 = 5.0;
const EQUAL_SHARE: f64 = 0.02;

/// An effect is a rival of the best if its gain is within this difference: fits that end in different minima differ by
/// ten in each flight, so the best need not be the true one.
const RIVAL: f64 = 20.0;

/// Gain by which a competitor must be better to replace the best.
const BETTER: f64 = 1.0;

/// Gain of a held-out flight that counts, relative to that of the fitted flights: movements differ, so one flight may say
/// more about an effect than another.
const CONFIRMS: f64 = 3.0;

/// Share of the way from neutral to the end of its range above which a parameter matters.
const MATERIAL: f64 = 0.02;

/// An effect fitted in addition to those named.
#[derive(Debug, Clone)]
pub struct Candidate {
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

impl Candidate {
    /// Gain in all flights, less the cost of the parameters.
    pub fn total(&self) -> f64 {
        self.gain + self.gains_held_out.iter().sum::<f64>() - COST * freedom(self.effect)
    }

    /// Gain to expect in all flights once everything is refitted. With large joint errors a held-out flight may seem to
    /// lose because of its own errors, so its loss is limited to half the gain of the fitted flights.
    pub fn promise(&self) -> f64 {
        let held_out = self.gains_held_out.iter();
        let held_out: f64 = held_out.map(|gain| gain.max(-0.5 * self.gain)).sum();
        self.gain + held_out - COST * freedom(self.effect)
    }

    /// Significance of its gain, in standard deviations.
    pub fn deviations(&self) -> f64 {
        deviations(2.0 * self.gain.max(0.0), freedom(self.effect))
    }

    /// Significance of the gain in all flights together. Held-out flights did not take part in the fit and so lose by
    /// chance; a gain far beyond that of the fitted flights is not counted.
    pub fn deviations_together(&self) -> f64 {
        let held_out = self.gains_held_out.iter();
        let most = CONFIRMS * self.gain;
        let gain = self.gain + held_out.map(|gain| gain.min(most)).sum::<f64>();
        deviations(2.0 * gain.max(0.0), freedom(self.effect))
    }

    /// Whether it is better than `best` after everything was refitted. Of two that are equally good, the first in the
    /// library is named.
    pub fn replaces(&self, best: &Self) -> bool {
        let is_equal = within(EQUAL, best.total(), self.total());
        let is_second = is_equal && best.effect < self.effect;
        self.total() > best.total() + BETTER && !is_second
    }

    /// Parameters of this effect.
    pub fn values(&self) -> [f64; PARAMETER_COUNT] {
        let own = self
            .effects
            .iter()
            .find(|(effect, _)| *effect == self.effect);
        own.map_or_else(|| self.effect.neutral(), |(_, values)| *values)
    }

    /// Standard errors of all effects: those of the linear problem times a factor for each parameter, one if missing.
    pub fn standard_errors(&self, wider: &[f64]) -> EffectSet {
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
    pub fn stretched(&self, share: f64) -> EffectSet {
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
    pub fn matters(&self) -> bool {
        let parameters = self.effect.description().parameters;
        parameters
            .iter()
            .zip(self.values())
            .any(|(parameter, value)| parameter.share_of_range(value) > MATERIAL)
    }

    /// Whether the fitted flights alone cannot distinguish it from `best`.
    pub fn gains_as_much_as(&self, best: &Self) -> bool {
        within(EQUAL, self.gain, best.gain)
    }

    /// Whether it is indistinguishable from `best`.
    pub fn is_rival_of(&self, best: &Self) -> bool {
        within(RIVAL, self.total(), best.total())
    }
}

/// Whether a gain is less than the best one by at most `margin`, or by the share within which effects are equally good.
fn within(margin: f64, gain: f64, best: f64) -> bool {
    gain > best - margin.max(EQUAL_SHARE * best)
}
