//! The choice: which effect explains most of what is left, and whether it deserves a name.

use bodyflight_core::effect::Effect;

use super::DISAGREES;
use super::design::Block;
use super::fit::{Data, Fit, Values};
use super::held_out::HeldOut;
use super::null::Null;
use super::report::{Named, Rival};
use super::stretch::Stretch;

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

/// Candidates that are looked at closely.
const SHORT_LIST: usize = 8;

/// A candidate, fitted with what was chosen before.
struct Candidate {
    effect: Effect,
    fit: Fit,
    /// The problem around that fit: what joints and subject have wrong acts differently there.
    pairs: Vec<(Stretch, Block)>,
    /// What the effect gains in flights in which nothing is missing, over its parameters.
    inflation: f64,
    /// Gains in the flights held out.
    votes: Vec<f64>,
    /// Deviations of the gain in all flights together beyond chance.
    deviations: f64,
}

impl Candidate {
    fn freedom(&self) -> f64 {
        self.effect.description().parameters.len() as f64
    }

    fn data<'a>(&'a self, data: &Data<'a>) -> Data<'a> {
        Data {
            stretches: &self.pairs,
            ..*data
        }
    }
}

/// An effect that deserves a name.
pub(super) struct Choice {
    /// Fitted with those chosen before.
    pub(super) fit: Fit,
    pub(super) named: Named,
    /// The problem around that fit.
    pub(super) pairs: Vec<(Stretch, Block)>,
}

/// The candidates that gain most by the problem as it stands, fitted again in the problem around each, best first.
fn short_list(
    data: &Data<'_>,
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
    out_of_question: &[Effect],
) -> Vec<Candidate> {
    let gain_over = |fit: &Fit| chosen.misfit - fit.misfit;
    let mut first: Vec<(Effect, f64, Fit, f64)> = Effect::ALL
        .iter()
        .filter(|effect| chosen.values.iter().all(|(known, _)| known != *effect))
        .filter(|effect| !out_of_question.contains(effect))
        .map(|&effect| {
            let inflation = null.inflation_of(effect);
            let mut values = chosen.values.clone();
            values.push((effect, effect.neutral()));
            let fit = data.fit(values, |_| true);
            let freedom = effect.description().parameters.len() as f64;
            let score = deviations(gain_over(&fit) / inflation, freedom);
            (effect, inflation, fit, score)
        })
        .collect();
    first.sort_by(|a, b| b.3.total_cmp(&a.3));
    first.truncate(SHORT_LIST);
    let before: Vec<f64> = others
        .iter()
        .map(|other| other.misfit(&chosen.values))
        .collect();
    let mut candidates: Vec<Candidate> = first
        .into_iter()
        .map(|(effect, inflation, fit, _)| {
            let pairs = data.moved_to(&fit.values);
            let there = Data {
                stretches: &pairs,
                ..*data
            };
            let fit = there.fit(fit.values, |_| true);
            let votes: Vec<f64> = others
                .iter()
                .zip(&before)
                .map(|(other, before)| before - other.misfit(&fit.values))
                .collect();
            let gain = (gain_over(&fit) + votes.iter().sum::<f64>()) / inflation;
            let freedom = effect.description().parameters.len() as f64;
            Candidate {
                effect,
                fit,
                pairs,
                inflation,
                votes,
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
    candidates
}

/// The effect that explains most of what is left, if it deserves a name, fitted with those chosen before.
pub(super) fn next(
    data: &Data<'_>,
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
    out_of_question: &[Effect],
) -> Option<Choice> {
    let mut candidates = short_list(data, others, null, chosen, out_of_question).into_iter();
    let best = candidates.next()?;
    let gain = chosen.misfit - best.fit.misfit;
    let left = chosen.misfit - null.misfit[0];
    let alone = deviations(gain / best.inflation, best.freedom());
    let least = if others.is_empty() {
        SIGNIFICANT_ALONE
    } else {
        SIGNIFICANT
    };
    let vetoed = best
        .votes
        .iter()
        .any(|vote| deviations(vote / best.inflation, best.freedom()) < VOTE);
    if alone < least
        || gain < MATERIAL * left
        || vetoed
        || !helps_elsewhere(&best.data(data), chosen, &best)
    {
        return None;
    }
    // Whoever explains as much, and leaves nothing for the best beside it.
    let rivals = candidates
        .filter(|rival| chosen.misfit - rival.fit.misfit > 0.8 * gain)
        .filter(|rival| {
            let mut values = rival.fit.values.clone();
            values.push((best.effect, best.effect.neutral()));
            let both = rival.data(data).fit(values, |_| true);
            deviations(rival.fit.misfit - both.misfit, best.freedom()) < SIGNIFICANT
        })
        .map(|rival| Rival {
            name: rival.effect.description().name,
            share: (chosen.misfit - rival.fit.misfit) / gain,
        })
        .collect();
    let named = Named::new(best.effect, alone, gain / left.max(1.0), rivals);
    Some(Choice {
        fit: best.fit,
        named,
        pairs: best.pairs,
    })
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
        let freedom = effect.description().parameters.len() as f64;
        let gain = (without.misfit - chosen.misfit) / null.inflation_of(effect);
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
