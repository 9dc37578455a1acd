//! The choice: which effect explains most of what is left, and whether it deserves a name.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};

use super::DISAGREES;
use super::design::{Around, freedom};
use super::fit::{Data, Fit, Values};
use super::held_out::HeldOut;
use super::null::Null;
use super::report::{Evidence, Named, Rival};
use super::stability::{Parts, stability};

/// Deviations of a gain beyond what drawn flights show, from which on it is significant: where flights held out
/// have a vote, alone and with them, and where they have none. What joints have wrong is the same all through one
/// flight, so its own halves cannot vote on that.
const SIGNIFICANT: f64 = 3.0;
const SIGNIFICANT_TOGETHER: f64 = 5.0;
pub(super) const SIGNIFICANT_ALONE: f64 = 9.0;

/// Deviations by which a flight held out must gain.
pub(super) const VOTE: f64 = 2.0;

/// Share of what is left to explain that an effect must explain to be material.
const MATERIAL: f64 = 0.1;

/// Share of its plausible range that a parameter must be away from nothing to be material: less may be what the fit's
/// own steps have wrong.
const MATERIAL_SHARE_OF_RANGE: f64 = 0.02;

/// Deviations of a chi-squared number of `freedom` degrees from its mean, as of a normal one (Wilson and Hilferty).
pub(super) fn deviations(chi_squared: f64, freedom: f64) -> f64 {
    let share = 2.0 / (9.0 * freedom);
    ((chi_squared / freedom).cbrt() - (1.0 - share)) / share.sqrt()
}

/// Candidates that are fitted with joints and subject, and those of them that are fitted in problems of their own and
/// for which all flights vote.
const SHORT_LIST: usize = 8;
const SHORTER_LIST: usize = 4;

/// Share of the best one's score that they must have for that.
const WITHIN_REACH: f64 = 0.25;

/// Share of the best one's gain that they must reach for the flights held out to be asked.
const IN_THE_RACE: f64 = 0.5;

/// How much more a start leaves than that of an effect that explains it all, where it is given up.
const FAR_BEHIND: f64 = 4.0;

/// A candidate, fitted with what was chosen before.
struct Candidate {
    effect: Effect,
    fit: Fit,
    /// The problem around that fit: what joints and subject have wrong acts differently there.
    around: Around,
    /// What the effect gains in flights in which nothing is missing, over its parameters.
    inflation: f64,
    /// Gains in the flights held out.
    votes: Vec<f64>,
    /// How much it is to be preferred, by the gain in all flights together.
    score: f64,
}

impl Candidate {
    fn freedom(&self) -> f64 {
        freedom(self.effect)
    }

    fn data<'a>(&'a self, data: &Data<'a>) -> Data<'a> {
        data.with(&self.around)
    }
}

/// An effect that deserves a name.
pub(super) struct Choice {
    /// Fitted with those chosen before.
    pub(super) fit: Fit,
    pub(super) named: Named,
}

/// Where a fit of an effect starts: from nothing, and where several parameters may hide in joints and subject one
/// behind the other, from halfway to both ends of their ranges.
pub(super) fn starts(effect: Effect, from_afar: bool) -> Vec<[f64; PARAMETER_COUNT]> {
    let sides: &[f64] = if from_afar && effect.description().parameters.len() > 1 {
        &[0.0, -0.5, 0.5]
    } else {
        &[0.0]
    };
    let start = |side: &f64| {
        let mut values = effect.neutral();
        for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
            *value = parameter.towards_end(*side);
        }
        values
    };
    sides.iter().map(start).collect()
}

/// The effects that gain most by a problem as it stands, fitted in it, best first.
fn near(
    data: &Data<'_>,
    null: &Null,
    chosen: &Fit,
    out_of_question: &[Effect],
    from_afar: bool,
) -> Vec<(Effect, Fit)> {
    let without = data.sketched(chosen.values.clone()).misfit;
    let mut first: Vec<(Effect, Fit, f64)> = Effect::ALL
        .iter()
        .filter(|effect| chosen.values.iter().all(|(known, _)| known != *effect))
        .filter(|effect| !out_of_question.contains(effect))
        .filter_map(|&effect| {
            let fits = starts(effect, from_afar).into_iter().map(|start| {
                let values = [chosen.values.as_slice(), &[(effect, start)]].concat();
                data.sketched(values)
            });
            let fit = fits.min_by(|a, b| a.misfit.total_cmp(&b.misfit))?;
            let gain = without - fit.misfit;
            Some((effect, fit, score(null, effect, gain)))
        })
        .collect();
    first.sort_by(|a, b| b.2.total_cmp(&a.2));
    first.truncate(SHORT_LIST);
    // Near the truth this is enough to rank them; from afar, where it does not converge, the sketch is.
    let without = data.settled(&chosen.values, |_| true).misfit;
    let mut near: Vec<(Effect, Fit, f64)> = first
        .into_iter()
        .map(|(effect, sketch, of_sketch)| {
            let fit = data.fit(sketch.values.clone(), |_| true);
            let of_fit = score(null, effect, without - fit.misfit);
            if of_fit > of_sketch {
                (effect, fit, of_fit)
            } else {
                (effect, sketch, of_sketch)
            }
        })
        .collect();
    near.sort_by(|a, b| b.2.total_cmp(&a.2));
    let best = near.first().map_or(0.0, |(.., score)| *score);
    near.retain(|(.., score)| *score > 0.0 && *score >= WITHIN_REACH * best);
    near.truncate(SHORTER_LIST);
    near.into_iter()
        .map(|(effect, fit, _)| (effect, fit))
        .collect()
}

/// The candidates that gain most in any of some problems, fitted again in the problem around each, best first.
fn short_list(
    problems: &[Data<'_>],
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
    out_of_question: &[Effect],
) -> Vec<Candidate> {
    let mut contenders: Vec<(Effect, Vec<(&Data<'_>, Fit)>)> = Vec::new();
    for (k, data) in problems.iter().enumerate() {
        for (effect, fit) in near(data, null, chosen, out_of_question, k == 0) {
            match contenders.iter_mut().find(|(known, _)| *known == effect) {
                Some((_, starts)) => starts.push((data, fit)),
                None => contenders.push((effect, vec![(data, fit)])),
            }
        }
    }
    for (_, starts) in &mut contenders {
        starts.sort_by(|a, b| a.1.misfit.total_cmp(&b.1.misfit));
    }
    let nearest =
        |starts: &[(&Data<'_>, Fit)]| starts.first().map_or(f64::INFINITY, |s| s.1.misfit);
    contenders.sort_by(|a, b| nearest(&a.1).total_cmp(&nearest(&b.1)));
    let voters: Vec<(&HeldOut<'_>, f64)> = others
        .iter()
        .map(|other| (other, other.misfit(&chosen.values)))
        .collect();
    let mut candidates: Vec<Candidate> = Vec::new();
    // Largest gain in this flight so far, beyond chance, that other flights do not take back.
    let mut most = 0.0_f64;
    let [expected, deviation] = null.misfit;
    let little = expected + DISAGREES * deviation;
    let enough = |fit: &Fit| fit.misfit < little;
    // Where the first that leaves little came from.
    let mut explained_from: Option<f64> = None;
    for (effect, starts) in contenders {
        let inflation = null.inflation_of(effect);
        let mut goal = chosen.misfit - IN_THE_RACE * most * inflation;
        // Where one explains it all, what leaves more is no rival, and what starts far behind will leave more.
        let start = nearest(&starts);
        if let Some(from) = explained_from {
            goal = goal.min(little);
            if start > FAR_BEHIND * from {
                continue;
            }
        }
        let Some((fit, around)) = refined_from(starts, goal) else {
            continue;
        };
        if fit.misfit > goal {
            continue;
        }
        let votes: Vec<f64> = voters
            .iter()
            .map(|(other, before)| before - other.misfit(&fit.values))
            .collect();
        let gain = chosen.misfit - fit.misfit;
        let together = gain + votes.iter().sum::<f64>();
        most = most.max(gain.min(together) / inflation);
        if chosen.misfit >= little && enough(&fit) && explained_from.is_none() {
            explained_from = Some(start);
        }
        candidates.push(Candidate {
            effect,
            score: score(null, effect, together),
            fit,
            around,
            inflation,
            votes,
        });
    }
    // Those first that leave no more than flights have in which nothing is missing; then by how far the gain is
    // beyond chance: some effects take up what joints have wrong, and gain by that alone.
    candidates.sort_by(|a, b| {
        let order = enough(&b.fit).cmp(&enough(&a.fit));
        order.then(b.score.total_cmp(&a.score))
    });
    candidates
}

/// The best fit from some starts, the nearest first. It may end in a valley that another start leads past.
fn refined_from(starts: Vec<(&Data<'_>, Fit)>, goal: f64) -> Option<(Fit, Around)> {
    let mut best: Option<(Fit, Around)> = None;
    for (data, fit) in starts {
        let goal = best
            .as_ref()
            .map_or(goal, |(best, _)| best.misfit.min(goal));
        let found = data.refined(fit, goal);
        if best
            .as_ref()
            .is_none_or(|(best, _)| found.0.misfit < best.misfit)
        {
            best = Some(found);
        }
    }
    best
}

/// How much an effect is to be preferred: its gain beyond chance, less what its parameters cost by Schwarz' criterion.
fn score(null: &Null, effect: Effect, gain: f64) -> f64 {
    gain / null.inflation_of(effect) - freedom(effect) * null.rows.ln()
}

/// The effect that explains most of what is left, if it deserves a name, fitted with those chosen before.
///
/// Of `problems` the last is around the fit chosen before; what others show from elsewhere is tried too.
pub(super) fn next(
    problems: &[Data<'_>],
    others: &[HeldOut<'_>],
    null: &Null,
    chosen: &Fit,
    out_of_question: &[Effect],
) -> Option<Choice> {
    let data = problems.last()?;
    let candidates = short_list(problems, others, null, chosen, out_of_question);
    let (best, rest) = candidates.split_first()?;
    let gain = chosen.misfit - best.fit.misfit;
    let left = chosen.misfit - null.misfit[0];
    let alone = deviations(gain / best.inflation, best.freedom());
    let votes: f64 = best.votes.iter().sum();
    let together = deviations((gain + votes) / best.inflation, best.freedom());
    let votes_for = |vote: &f64| deviations(vote / best.inflation, best.freedom()) >= VOTE;
    // Without flights that vote its own halves have to.
    let significant = if others.is_empty() {
        alone >= SIGNIFICANT_ALONE && helps_elsewhere(&best.data(data), chosen, best)
    } else {
        alone >= SIGNIFICANT && together >= SIGNIFICANT_TOGETHER && best.votes.iter().all(votes_for)
    };
    if !significant || gain < MATERIAL * left || !is_material(best) {
        return None;
    }
    // Whoever explains as much, and leaves nothing for the best beside it.
    let is_rival = |rival: &Candidate| {
        if chosen.misfit - rival.fit.misfit <= 0.8 * gain {
            return false;
        }
        let mut values = rival.fit.values.clone();
        values.push((best.effect, best.effect.neutral()));
        let both = rival.data(data).fit(values, |_| true);
        deviations(rival.fit.misfit - both.misfit, best.freedom()) < SIGNIFICANT_TOGETHER
    };
    let (as_good, rivals): (Vec<usize>, Vec<Rival>) = rest
        .iter()
        .enumerate()
        .filter(|(_, rival)| is_rival(rival))
        .map(|(k, rival)| {
            let share = (chosen.misfit - rival.fit.misfit) / gain;
            let name = rival.effect.description().name;
            (k + 1, Rival { name, share })
        })
        .unzip();
    let parts: Vec<Parts> = candidates
        .iter()
        .map(|candidate| Parts::of(&candidate.data(data), &candidate.fit))
        .collect();
    let before = Parts::of(data, chosen);
    let stability = stability(&before, &parts, &as_good, |k, gain| {
        score(null, candidates[k].effect, gain)
    });
    let evidence = Evidence {
        deviations: alone,
        chance: Some(null.chance_of(alone)),
        stability: Some(stability),
        explains: gain / left.max(1.0),
    };
    let named = Named::new(best.effect, evidence, rivals);
    Some(Choice {
        fit: best.fit.clone(),
        named,
    })
}

/// Whether a parameter is at least a small share of its range away from nothing.
fn is_material(candidate: &Candidate) -> bool {
    let parameters = candidate.effect.description().parameters;
    let fitted = candidate.fit.values.last().map(|(_, values)| values);
    let mut shares = fitted
        .into_iter()
        .flatten()
        .zip(parameters)
        .map(|(value, parameter)| parameter.share_of_range(*value));
    shares.any(|share| share > MATERIAL_SHARE_OF_RANGE)
}

/// Without the effects that are no longer worth having beside the last one, and which these are.
pub(super) fn pruned(data: &Data<'_>, null: &Null, mut chosen: Fit) -> (Fit, Vec<Effect>) {
    let earlier: Vec<Effect> = chosen
        .values
        .iter()
        .rev()
        .skip(1)
        .map(|(effect, _)| *effect)
        .collect();
    let mut dropped = Vec::new();
    for effect in earlier {
        let rest: Values = chosen
            .values
            .iter()
            .copied()
            .filter(|(e, _)| *e != effect)
            .collect();
        let without = data.fit(rest, |_| true);
        let gain = (without.misfit - chosen.misfit) / null.inflation_of(effect);
        if deviations(gain, freedom(effect)) < SIGNIFICANT_ALONE {
            dropped.push(effect);
            chosen = without;
        }
    }
    (chosen, dropped)
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
        let misfit = |values: &Values| data.settled(values, other).misfit;
        gain += misfit(&chosen.values) - misfit(&fit.values);
    }
    gain > 0.0
}
