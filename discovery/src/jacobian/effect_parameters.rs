//! Parameters of effects as columns of a fit.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, Model, Parameter, extended};
use nalgebra::{DMatrix, DVector};

use crate::jacobian::layout::components;

/// The effects of a set that change at random.
pub(crate) fn random(effects: &EffectSet) -> EffectSet {
    let random = effects.iter().filter(|(effect, _)| effect.is_random());
    random.copied().collect()
}

/// A parameter of an effect: one column of a fit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ParameterId {
    /// The effect.
    pub effect: Effect,
    /// Which of its parameters.
    pub index: usize,
}

impl ParameterId {
    /// Name, plausible range and neutral value.
    fn parameter(self) -> &'static Parameter {
        &self.effect.description().parameters[self.index]
    }

    /// Half the plausible range: the standard deviation of the prior.
    pub fn prior_deviation(self) -> f64 {
        let parameter = self.parameter();
        0.5 * (parameter.high - parameter.low)
    }
}

/// Parameters of an effect that are fitted as columns; those of an effect that changes at random are variances instead.
fn fitted(effect: Effect) -> &'static [Parameter] {
    if effect.is_random() {
        &[]
    } else {
        effect.description().parameters
    }
}

/// Parameters of an effect that a search estimates: the strengths if it changes at random.
pub(crate) fn estimated(effect: Effect) -> &'static [Parameter] {
    let parameters = effect.description().parameters;
    if effect.is_random() {
        &parameters[..components(effect).len()]
    } else {
        parameters
    }
}

/// All parameters of some effects, in order.
pub(crate) fn parameters_of(effects: impl IntoIterator<Item = Effect>) -> Vec<ParameterId> {
    let parameters = |effect: Effect| {
        let count = fitted(effect).len();
        (0..count).map(move |index| ParameterId { effect, index })
    };
    effects.into_iter().flat_map(parameters).collect()
}

/// All parameters of all effects.
pub(crate) fn all_parameters() -> Vec<ParameterId> {
    parameters_of(Effect::ALL.iter().copied())
}

/// Number of estimated parameters of an effect, the degrees of freedom of its gain.
pub(crate) fn freedom(effect: Effect) -> f64 {
    estimated(effect).len() as f64
}

/// The parameters of all effects as a vector.
pub(crate) fn numbers(effects: &EffectSet) -> DVector<f64> {
    let each = effects.iter().flat_map(|(effect, values)| {
        let count = fitted(*effect).len();
        values[..count].to_vec()
    });
    DVector::from_vec(each.collect())
}

/// The largest change of a parameter, in its standard errors.
pub(crate) fn furthest(from: &EffectSet, to: &EffectSet, covariance: &DMatrix<f64>) -> f64 {
    let moves = numbers(to) - numbers(from);
    let each = moves.iter().enumerate();
    each.map(|(k, moved)| moved.abs() / covariance[(k, k)].sqrt())
        .fold(0.0, f64::max)
}

/// The effects halfway between `from` and `to`.
pub(crate) fn between(from: &EffectSet, to: &EffectSet) -> EffectSet {
    moved(from, &((numbers(to) - numbers(from)) * 0.5))
}

/// The effects after a step, clamped to their plausible ranges.
pub(crate) fn moved(effects: &EffectSet, step: &DVector<f64>) -> EffectSet {
    let mut steps = step.iter();
    let mut moved = effects.clone();
    for (effect, values) in &mut moved {
        for (value, parameter) in values.iter_mut().zip(fitted(*effect)) {
            *value += steps.next().copied().unwrap_or(0.0);
            *value = value.clamp(parameter.low, parameter.high);
        }
    }
    moved
}

/// The plain model with effects of which one parameter is changed by a small step, and the step that the plausible
/// range allowed.
///
/// Effects are applied to the plain model again, because some multiply existing values or replace them.
pub(crate) fn changed(
    plain: &Model<f64>,
    effects: &EffectSet,
    id: ParameterId,
) -> (Model<f64>, f64) {
    let mut effects = effects.clone();
    if !effects.iter().any(|(effect, _)| *effect == id.effect) {
        effects.push((id.effect, id.effect.neutral()));
    }
    let parameter = id.parameter();
    let mut size = 0.02 * (parameter.high - parameter.low);
    for (effect, values) in &mut effects {
        if *effect == id.effect {
            let value = &mut values[id.index];
            if *value + size > parameter.high {
                size = -size;
            }
            *value += size;
        }
    }
    (extended(plain, &effects), size)
}
