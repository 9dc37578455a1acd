//! Drops named effects that a later one has made redundant.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::Effect;

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{NamedEffect, differs};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::robust_covariance::error_bars;
use crate::hypotheses::score_test::JointFit;

/// The first effect, apart from the last one, that does not differ from neutral.
fn redundant(effects: &EffectSet, errors: &EffectSet) -> Option<Effect> {
    let (_, earlier) = effects.split_last()?;
    let mut each = earlier.iter().zip(errors);
    each.find(|(effect, errors)| !differs(effect, errors, None))
        .map(|((effect, _), _)| *effect)
}

/// Drops every name whose effect no longer differs from neutral beside the last one, if the flights are about as
/// likely without it: a gradient of the wind, for instance, once the wind itself is named. `errors` are the standard
/// errors of the effects.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn without_redundant<'a>(
    refit: &Refit<'a>,
    mut joint_fit: JointFit<'a>,
    mut errors: EffectSet,
    names: &mut Vec<NamedEffect>,
) -> Result<JointFit<'a>> {
    while let Some(effect) = redundant(&joint_fit.effects, &errors) {
        let Some(without) = fitted_without(refit, &joint_fit, effect)? else {
            break;
        };
        if without.likelihood() < joint_fit.likelihood() - DECISION.total_gain {
            break;
        }
        names.retain(|name| name.hypothesis.effect != effect);
        joint_fit = without;
        errors = error_bars(&joint_fit, refit.progress).errors;
    }
    Ok(joint_fit)
}

/// Refits the flights without one of the effects.
fn fitted_without<'a>(
    refit: &Refit<'a>,
    joint_fit: &JointFit<'a>,
    effect: Effect,
) -> Result<Option<JointFit<'a>>> {
    let others = joint_fit
        .effects
        .iter()
        .filter(|(other, _)| *other != effect);
    let others: EffectSet = others.copied().collect();
    let each = joint_fit.fitted.iter();
    let points: Vec<_> = each
        .clone()
        .map(|(_, fitted)| fitted.point_with(&others))
        .collect();
    let errors: Vec<_> = each.map(|(_, fitted)| Some(&fitted.errors)).collect();
    let Some(first) = refit.fitted(&points, &errors)? else {
        return Ok(None);
    };
    let round = refit.with_same_slopes(refit.round(first, others)?)?;
    let (fitted, effects) = refit.with_new_slopes(round)?;
    refit.with_held_out(fitted, joint_fit, effects)
}
