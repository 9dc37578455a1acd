//! Drops named effects that a later one has made redundant.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::Effect;

use crate::error::Result;
use crate::hypotheses::hypothesis::{NamedEffect, is_significant};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::robust_covariance::{ErrorBars, error_bars};
use crate::hypotheses::score_test::JointFit;

/// Drops every name that is no longer certain beside the last one: a gradient of the wind, for instance, once the wind
/// itself is named. `bars` are those of the effects.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn without_redundant<'a>(
    refit: &Refit<'a>,
    mut joint_fit: JointFit<'a>,
    mut bars: ErrorBars,
    names: &mut Vec<NamedEffect>,
) -> Result<JointFit<'a>> {
    while let Some(redundant) = bars.redundant() {
        let Some(without) = fitted_without(refit, &joint_fit, redundant.effect)? else {
            break;
        };
        let beside = refit.compared(&without, &joint_fit, &redundant)?;
        if is_significant(&without.checked_without_refit(beside, refit.progress)) {
            break;
        }
        names.retain(|name| name.hypothesis.effect != redundant.effect);
        joint_fit = without;
        bars = error_bars(&joint_fit, refit.progress);
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
