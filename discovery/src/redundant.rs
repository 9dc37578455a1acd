//! Drops named effects that a later one has made redundant.

use bodyflight_core::effect::Effect;

use super::contest::Scene;
use super::effect_set::EffectSet;
use super::error::Result;
use super::search::{ALL_TOGETHER, Name, Search, differs};

/// The first effect, apart from the last one, that does not differ from neutral.
fn redundant(effects: &EffectSet, errors: &EffectSet) -> Option<Effect> {
    let (_, earlier) = effects.split_last()?;
    let mut each = earlier.iter().zip(errors);
    each.find(|(effect, errors)| !differs(effect, errors, None))
        .map(|((effect, _), _)| *effect)
}

impl<'a> Search<'a> {
    /// Drops every name whose effect no longer differs from neutral beside the last one, if the flights are about as
    /// likely without it: a gradient of the wind, for instance, once the wind itself is named. `errors` are the standard
    /// errors of the effects.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn without_redundant(
        &self,
        mut scene: Scene<'a>,
        mut errors: EffectSet,
        names: &mut Vec<Name>,
    ) -> Result<Scene<'a>> {
        while let Some(effect) = redundant(&scene.effects, &errors) {
            let Some(without) = self.fitted_without(&scene, effect)? else {
                break;
            };
            if without.likelihood() < scene.likelihood() - ALL_TOGETHER {
                break;
            }
            names.retain(|name| name.candidate.effect != effect);
            scene = without;
            errors = self.error_bars(&scene).errors;
        }
        Ok(scene)
    }

    /// Refits the flights without one of the effects.
    fn fitted_without(&self, scene: &Scene<'a>, effect: Effect) -> Result<Option<Scene<'a>>> {
        let others = scene.effects.iter().filter(|(other, _)| *other != effect);
        let others: EffectSet = others.copied().collect();
        let each = scene.fitted.iter();
        let beliefs: Vec<_> = each
            .clone()
            .map(|(_, fitted)| fitted.belief_with(&others))
            .collect();
        let errors: Vec<_> = each.map(|(_, fitted)| Some(&fitted.errors)).collect();
        let Some(first) = self.fitted(&beliefs, &errors)? else {
            return Ok(None);
        };
        let round = self.with_same_slopes(self.round(first, others)?)?;
        let (fitted, effects) = self.with_new_slopes(round)?;
        self.with_held_out(fitted, scene, effects)
    }
}
