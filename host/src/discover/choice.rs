//! The choice: which effect explains most of what is left, and whether it deserves a name.

use bodyflight_core::effect::Effect;

use super::DISAGREES;
use super::fit::{Data, Fit, Values};
use super::held_out::HeldOut;
use super::null::Null;
use super::report::{Named, Rival};

/// Deviations of a gain beyond what drawn flights show, from which on it is significant: where flights held out
/// have a vote, and where they have none. What joints have wrong is the same all through one flight, so its own
/// halves cannot vote on that.
const SIGNIFICANT: f64 = 4.5;
const SIGNIFICANT_ALONE: f64 = 9.0;

/// Deviations by which a flight held out must gain.
const VOTE: f64 = 2.0;

/// Share of what is left to explain that an effect must explain to be material.
const MATERIAL: f64 = 0.1;

/// Deviations of a chi-squared number of `freedom` degrees from its mean, as of a normal one (Wilson and Hilferty).
fn deviations(chi_squared: f64, freedom: f64) -> f64 {
    let share = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - share)) / share.sqrt()
}

/// A candidate, fitted with what was chosen before.
struct Candidate {
    effect: Effect,
    fit: Fit,
    /// What the effect gains in flights in which nothing is missing, over its parameters.
    inflation: f64,
    deviations: f64,
}

/// The effect that explains most of what is left, if it deserves a name, fitted with those chosen before.
pub(super) fn next(
    data: &Data<'_>,
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
) -> Option<(Fit, Named)> {
    let all = |_: usize| true;
    let mut candidates: Vec<Candidate> = Effect::ALL
        .iter()
        .zip(&null.inflation)
        .filter(|(effect, _)| chosen.values.iter().all(|(known, _)| known != *effect))
        .map(|(&effect, inflation)| {
            let mut values = chosen.values.clone();
            values.push((effect, effect.neutral()));
            let fit = data.fit(values, all);
            let freedom = effect.description().parameters.len() as f64;
            let gain = (chosen.misfit - fit.misfit) / inflation;
            Candidate {
                effect,
                fit,
                inflation: *inflation,
                deviations: deviations(gain, freedom),
            }
        })
        .collect();
    // Those first that leave no more than flights have in which nothing is missing; then by how far the gain is
    // beyond chance: some effects take up what joints have wrong, and gain by that alone.
    let [expected, deviation] = null.misfit;
    let enough = |candidate: &Candidate| candidate.fit.misfit < expected + DISAGREES * deviation;
    candidates.sort_by(|a, b| {
        let order = enough(b).cmp(&enough(a));
        order.then(b.deviations.total_cmp(&a.deviations))
    });
    let mut candidates = candidates.into_iter();
    let best = candidates.next()?;
    let left = chosen.misfit - null.misfit[0];
    let gain = chosen.misfit - best.fit.misfit;
    let least = if others.is_empty() {
        SIGNIFICANT_ALONE
    } else {
        SIGNIFICANT
    };
    let vetoed = others.iter().any(|other| {
        let gain = other.misfit(&chosen.values) - other.misfit(&best.fit.values);
        let freedom = best.effect.description().parameters.len() as f64;
        deviations(gain / best.inflation, freedom) < VOTE
    });
    if best.deviations < least
        || gain < MATERIAL * left
        || vetoed
        || !helps_elsewhere(data, chosen, &best)
    {
        return None;
    }
    // Whoever explains as much, and leaves nothing for the best beside it.
    let rivals = candidates
        .filter(|rival| chosen.misfit - rival.fit.misfit > 0.8 * gain)
        .filter(|rival| {
            let mut values = rival.fit.values.clone();
            values.push((best.effect, best.effect.neutral()));
            let both = data.fit(values, all);
            let freedom = best.effect.description().parameters.len() as f64;
            deviations(rival.fit.misfit - both.misfit, freedom) < SIGNIFICANT
        })
        .map(|rival| Rival {
            name: rival.effect.description().name,
            share: (chosen.misfit - rival.fit.misfit) / gain,
        })
        .collect();
    let named = Named::new(best.effect, best.deviations, gain / left.max(1.0), rivals);
    Some((best.fit, named))
}

/// Without the effects that are no longer worth having beside the last one.
pub(super) fn pruned(data: &Data<'_>, null: &Null, mut chosen: Fit, named: &mut Vec<Named>) -> Fit {
    let earlier: Vec<Effect> = chosen
        .values
        .iter()
        .rev()
        .skip(1)
        .map(|(effect, _)| *effect)
        .collect();
    for effect in earlier {
        let rest: Values = chosen
            .values
            .iter()
            .copied()
            .filter(|(e, _)| *e != effect)
            .collect();
        let without = data.fit(rest, |_| true);
        let inflation = Effect::ALL
            .iter()
            .zip(&null.inflation)
            .find(|(e, _)| **e == effect);
        let inflation = inflation.map_or(1.0, |(_, inflation)| *inflation);
        let freedom = effect.description().parameters.len() as f64;
        let gain = (without.misfit - chosen.misfit) / inflation;
        if deviations(gain, freedom) < SIGNIFICANT_ALONE {
            named.retain(|named| named.effect() != effect);
            chosen = without;
        }
    }
    chosen
}

/// Whether an effect fitted to every other pair of stretches helps in the rest, both ways.
fn helps_elsewhere(data: &Data<'_>, chosen: &Fit, candidate: &Candidate) -> bool {
    let mut gain = 0.0;
    for half in 0..2 {
        let own = move |k: usize| (k / 2) % 2 == half;
        let other = move |k: usize| (k / 2) % 2 != half;
        let mut values = chosen.values.clone();
        values.push((candidate.effect, candidate.effect.neutral()));
        let fit = data.fit(values, own);
        gain += data.misfit(&chosen.values, other) - data.misfit(&fit.values, other);
    }
    gain > 0.0
}
