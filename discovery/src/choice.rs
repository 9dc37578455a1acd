//! The choice: which effect explains most of what is left, and whether it deserves a name.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};

use super::criteria::{SIGNIFICANT_ALONE, VOTE};
use super::effect_set::{EffectSet, freedom};
use super::error::Result;
use super::fit::{Data, Fit};
use super::held_out::HeldOut;
use super::null_distribution::NullDistribution;
use super::progress::{Progress, check};
use super::race::{Candidate, Contender, Race};
use super::report::{Evidence, Named, Rival};
use super::stability::{Parts, stability};
use super::statistics::deviations;

/// Deviations of a gain beyond what drawn flights show, from which on it is significant where flights held out have a
/// vote: alone, and with them.
const SIGNIFICANT: f64 = 3.0;
const SIGNIFICANT_TOGETHER: f64 = 5.0;

/// Share of what is left to explain that an effect must explain to be material.
const MATERIAL: f64 = 0.1;

/// Share of its plausible range that a parameter must be away from nothing to be material: less may be what the fit's
/// own steps have wrong.
const MATERIAL_SHARE_OF_RANGE: f64 = 0.02;

/// Candidates that are fitted with joints and subject, and those of them that are linearized about fits of their own
/// and for which all flights vote.
const SHORT_LIST: usize = 8;
const SHORTER_LIST: usize = 4;

/// Share of the best one's score that they must have for that.
const WITHIN_REACH: f64 = 0.25;

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

/// What a choice is made from.
pub(super) struct Contest<'a> {
    /// The flight, linearized in several places: the last about the fit chosen before; what others show is tried too.
    pub(super) problems: &'a [Data<'a>],
    /// Flights that have a vote.
    pub(super) others: &'a [HeldOut<'a>],
    pub(super) null: &'a NullDistribution,
    /// The fit so far.
    pub(super) chosen: &'a Fit,
    /// Effects that are not asked again.
    pub(super) out_of_question: &'a [Effect],
    pub(super) progress: &'a dyn Progress,
}

/// The effect that explains most of what is left, if it deserves a name, fitted with those chosen before.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(super) fn next(contest: &Contest<'_>) -> Result<Option<Choice>> {
    let candidates = contest.short_list()?;
    let (Some((best, rest)), Some(data)) = (candidates.split_first(), contest.problems.last())
    else {
        return Ok(None);
    };
    let gain = contest.gain(best);
    let left = contest.chosen.misfit - contest.null.misfit[0];
    if !contest.is_significant(best, data) || gain < MATERIAL * left || !is_material(best) {
        return Ok(None);
    }
    let (as_good, rivals) = contest.rivals(best, rest, data);
    let parts: Vec<Parts> = candidates
        .iter()
        .map(|candidate| Parts::of(&candidate.data(data), &candidate.fit))
        .collect();
    let before = Parts::of(data, contest.chosen);
    let stability = stability(&before, &parts, &as_good, |k, gain| {
        contest.null.score(candidates[k].effect, gain)
    });
    let alone = best.deviations(gain);
    let evidence = Evidence {
        deviations: alone,
        chance: Some(contest.null.chance_of(alone)),
        stability: Some(stability),
        explains: gain / left.max(1.0),
    };
    Ok(Some(Choice {
        fit: best.fit.clone(),
        named: Named::new(best.effect, evidence, rivals),
    }))
}

impl<'a> Contest<'a> {
    /// What a candidate takes off the misfit.
    fn gain(&self, candidate: &Candidate) -> f64 {
        self.chosen.misfit - candidate.fit.misfit
    }

    /// The effects that gain most by a problem as it stands, fitted in it, best first.
    fn near(&self, data: &Data<'_>, from_afar: bool) -> Result<Vec<(Effect, Fit)>> {
        let sketches = self.sketches(data, from_afar)?;
        // Near the truth this is enough to rank them; from afar, where it does not converge, the sketch is.
        let without = data.profiled(&self.chosen.effects, |_| true).misfit;
        let mut near: Vec<(Effect, Fit, f64)> = Vec::new();
        for (effect, sketch, of_sketch) in sketches {
            check(self.progress)?;
            let fit = data.fit(sketch.effects.clone(), |_| true);
            let of_fit = self.null.score(effect, without - fit.misfit);
            near.push(if of_fit > of_sketch {
                (effect, fit, of_fit)
            } else {
                (effect, sketch, of_sketch)
            });
        }
        near.sort_by(|a, b| b.2.total_cmp(&a.2));
        let best = near.first().map_or(0.0, |(.., score)| *score);
        near.retain(|(.., score)| *score > 0.0 && *score >= WITHIN_REACH * best);
        near.truncate(SHORTER_LIST);
        let fits = near.into_iter().map(|(effect, fit, _)| (effect, fit));
        Ok(fits.collect())
    }

    /// All effects that are asked, sketched in a problem, with their scores: the best of them.
    fn sketches(&self, data: &Data<'_>, from_afar: bool) -> Result<Vec<(Effect, Fit, f64)>> {
        let chosen = &self.chosen.effects;
        let without = data.sketched(chosen.clone()).misfit;
        let asked = Effect::ALL
            .iter()
            .filter(|effect| chosen.iter().all(|(known, _)| known != *effect))
            .filter(|effect| !self.out_of_question.contains(effect));
        let mut sketches = Vec::new();
        for &effect in asked {
            check(self.progress)?;
            let fits = starts(effect, from_afar)
                .into_iter()
                .map(|start| data.sketched([chosen.as_slice(), &[(effect, start)]].concat()));
            if let Some(fit) = fits.min_by(|a, b| a.misfit.total_cmp(&b.misfit)) {
                let gain = without - fit.misfit;
                sketches.push((effect, fit, self.null.score(effect, gain)));
            }
        }
        sketches.sort_by(|a, b| b.2.total_cmp(&a.2));
        sketches.truncate(SHORT_LIST);
        Ok(sketches)
    }

    /// The effects that are near in any of the problems, the nearest first.
    fn contenders(&self) -> Result<Vec<Contender<'a>>> {
        let mut contenders: Vec<Contender<'a>> = Vec::new();
        for (k, data) in self.problems.iter().enumerate() {
            for (effect, fit) in self.near(data, k == 0)? {
                match contenders.iter_mut().find(|known| known.effect == effect) {
                    Some(known) => known.starts.push((data, fit)),
                    None => contenders.push(Contender {
                        effect,
                        starts: vec![(data, fit)],
                    }),
                }
            }
        }
        for contender in &mut contenders {
            let starts = &mut contender.starts;
            starts.sort_by(|a, b| a.1.misfit.total_cmp(&b.1.misfit));
        }
        contenders.sort_by(|a, b| a.nearest().total_cmp(&b.nearest()));
        Ok(contenders)
    }

    /// The contenders linearized about their own fits, best first.
    fn short_list(&self) -> Result<Vec<Candidate>> {
        let contenders = self.contenders()?;
        let mut race = Race::new(self.null, self.chosen, self.others);
        let mut candidates = Vec::new();
        for contender in contenders {
            check(self.progress)?;
            candidates.extend(race.run(contender));
        }
        // Those first that leave no more than flights have in which nothing is missing; then by how far the gain is
        // beyond chance: some effects take up what joints have wrong, and gain by that alone.
        let enough = |candidate: &Candidate| candidate.fit.misfit < self.null.little();
        candidates.sort_by(|a, b| {
            let order = enough(b).cmp(&enough(a));
            order.then(b.score.total_cmp(&a.score))
        });
        Ok(candidates)
    }

    /// Whether the gain of a candidate is beyond chance, here and in the flights held out. Without flights that vote
    /// its own halves have to.
    fn is_significant(&self, best: &Candidate, data: &Data<'_>) -> bool {
        let gain = self.gain(best);
        let alone = best.deviations(gain);
        if self.others.is_empty() {
            return alone >= SIGNIFICANT_ALONE
                && helps_elsewhere(&best.data(data), self.chosen, best);
        }
        let votes: f64 = best.votes.iter().sum();
        let votes_for = |vote: &f64| best.deviations(*vote) >= VOTE;
        alone >= SIGNIFICANT
            && best.deviations(gain + votes) >= SIGNIFICANT_TOGETHER
            && best.votes.iter().all(votes_for)
    }

    /// Whoever explains as much as the best, and leaves nothing for it beside itself: indices among all candidates, and
    /// names.
    fn rivals(
        &self,
        best: &Candidate,
        rest: &[Candidate],
        data: &Data<'_>,
    ) -> (Vec<usize>, Vec<Rival>) {
        let gain = self.gain(best);
        let is_rival = |rival: &Candidate| {
            if self.gain(rival) <= 0.8 * gain {
                return false;
            }
            let mut effects = rival.fit.effects.clone();
            effects.push((best.effect, best.effect.neutral()));
            let both = rival.data(data).fit(effects, |_| true);
            deviations(rival.fit.misfit - both.misfit, best.freedom()) < SIGNIFICANT_TOGETHER
        };
        rest.iter()
            .enumerate()
            .filter(|(_, rival)| is_rival(rival))
            .map(|(k, rival)| {
                let share = self.gain(rival) / gain;
                let name = rival.effect.description().name;
                (k + 1, Rival { name, share })
            })
            .unzip()
    }
}

/// Whether a parameter is at least a small share of its range away from nothing.
fn is_material(candidate: &Candidate) -> bool {
    let parameters = candidate.effect.description().parameters;
    let fitted = candidate.fit.effects.last().map(|(_, values)| values);
    let mut shares = fitted
        .into_iter()
        .flatten()
        .zip(parameters)
        .map(|(value, parameter)| parameter.share_of_range(*value));
    shares.any(|share| share > MATERIAL_SHARE_OF_RANGE)
}

/// Without the effects that are no longer worth having beside the last one, and which these are.
pub(super) fn pruned(
    data: &Data<'_>,
    null: &NullDistribution,
    mut chosen: Fit,
) -> (Fit, Vec<Effect>) {
    let earlier: Vec<Effect> = chosen
        .effects
        .iter()
        .rev()
        .skip(1)
        .map(|(effect, _)| *effect)
        .collect();
    let mut dropped = Vec::new();
    for effect in earlier {
        let others: EffectSet = chosen
            .effects
            .iter()
            .copied()
            .filter(|(e, _)| *e != effect)
            .collect();
        let without = data.fit(others, |_| true);
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
        let mut effects = chosen.effects.clone();
        effects.push((candidate.effect, candidate.effect.neutral()));
        let fit = data.fit(effects, own);
        let misfit = |effects: &EffectSet| data.profiled(effects, other).misfit;
        gain += misfit(&chosen.effects) - misfit(&fit.effects);
    }
    gain > 0.0
}
