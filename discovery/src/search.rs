//! The search: errors are estimated, and an effect is named if the flights are much more likely with it than without
//! it, including those held out.

use bodyflight_core::effect::Effect;

use super::contest::{Candidate, Scene};
use super::description::described;
use super::effect_set::EffectSet;
use super::error::{Error, Result};
use super::error_model::Errors;
use super::linearization::Belief;
use super::nuisance::Tolerances;
use super::problem::{Fitted, Problem};
use super::progress::{Progress, begin, check};
use super::remainder::{unadjusted, without_push};
use super::report::{Outcome, Report, Rival};
use super::statistics::quantile_of_sorted;
use super::track::Track;

/// Settings of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Largest number of effects to name.
    pub max_effects: usize,
    /// Seed of what is drawn.
    pub seed: u64,
    /// Tolerances of suit, subject and sensors.
    pub tolerances: Tolerances,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_effects: 3,
            seed: 1,
            tolerances: Tolerances::default(),
        }
    }
}

/// Shortest flight that is judged (stretches, s).
const SHORTEST: usize = 2;
const LEAST_S: f64 = 4.0;

/// Deviations by which a named effect must exceed the best effect of a hundred random draws, and the least in any case.
const BEYOND_CHANCE: f64 = 1.0;
const LEAST: f64 = 4.5;
/// Without a flight held out.
const LEAST_ALONE: f64 = 7.0;

/// Gain that a flight held out must have, and all flights together after what parameters cost.
const VOTE: f64 = 2.0;
const ALL_TOGETHER: f64 = 12.0;

/// Effects that are given up before the search is.
const TRIED: usize = 3;

/// Fits of errors beside an effect, and how far the effect moves at last (standard errors).
const ROUNDS: usize = 5;
const SETTLED: f64 = 0.4;

/// How strong an effect is at first, by the strength that it has to first order.
const STARTS: [f64; 2] = [1.0, 2.2];

/// Share of a search that the errors take, and of what is left that another effect leaves.
const ERRORS: f64 = 0.4;
const ANOTHER: f64 = 0.3;

/// Share of half the plausible range from which on an effect matters.
const MATERIAL: f64 = 0.02;

/// Searches for what the model misses in flights of one subject; the flights in `held_out` are not fitted, but must
/// agree.
///
/// # Errors
/// Returns an error if a flight is too short to be judged, or if the search was cancelled.
pub fn discover(
    flights: &[Track],
    held_out: &[Track],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Report> {
    begin(progress, "noise of the sensors")?;
    let problem = |track: &Track| -> Result<()> {
        let found_s = track.duration();
        let least_s = LEAST_S;
        if super::stretch::stretches(track).len() < SHORTEST {
            return Err(Error::TooShort { least_s, found_s });
        }
        Ok(())
    };
    flights.iter().chain(held_out).try_for_each(problem)?;
    if flights.is_empty() {
        return Err(Error::TooShort {
            least_s: LEAST_S,
            found_s: 0.0,
        });
    }
    let mut problems: Vec<Problem<'_>> = flights
        .iter()
        .chain(held_out)
        .map(|track| Problem::new(track, &settings.tolerances))
        .collect();
    begin(progress, "errors of suit, subject and sensors")?;
    let mut alone = Vec::new();
    let all = problems.len() as f64;
    for (k, problem) in problems.iter_mut().enumerate() {
        alone.push(Alone::new(problem, progress)?);
        progress.reached(ERRORS * (k + 1) as f64 / all);
    }
    let search = Search {
        problems: &problems,
        count: flights.len(),
        settings,
        progress,
    };
    search.run(alone)
}

/// A flight fitted as if nothing were missing.
struct Alone {
    /// Linearized around the files: fitted constants cannot hide what is missing.
    around_files: Fitted,
    /// Linearized around the constants of the flight itself.
    settled: Fitted,
}

impl Alone {
    fn new(problem: &mut Problem<'_>, progress: &dyn Progress) -> Result<Self> {
        let too_short = Error::TooShort {
            least_s: LEAST_S,
            found_s: problem.track.duration(),
        };
        let files = Belief::files();
        problem.without_stretches_beyond_numbers(&files);
        let first = problem.fit(&files, None, 1, progress)?.ok_or(too_short)?;
        problem.weigh(&first);
        let around_files = problem
            .fit(&first.belief_wandering(), Some(&first.errors), 1, progress)?
            .ok_or(too_short)?;
        let belief = around_files.belief_with(&EffectSet::new());
        // Where the fitted constants cannot be flown, those of the files are kept.
        let settled = match problem.fit(&belief, Some(&around_files.errors), 1, progress)? {
            Some(settled) => settled,
            None => problem
                .fit(&files, Some(&around_files.errors), 1, progress)?
                .ok_or(too_short)?,
        };
        Ok(Self {
            around_files,
            settled,
        })
    }
}

/// Whether a candidate is worth fitting everything anew beside it: errors that were fitted without it may take a part of
/// what it does, so less than for a name is asked for.
fn promises(candidate: &Candidate, chance: &[f64]) -> bool {
    let votes = candidate.gains_held_out.iter().all(|gain| *gain > 0.0);
    votes && candidate.deviations() > quantile_of_sorted(chance, 0.99)
}

/// A search in flights whose errors are known as far as nothing is missing.
pub(super) struct Search<'a> {
    problems: &'a [Problem<'a>],
    /// Flights that are fitted; the others are held out.
    count: usize,
    settings: &'a Settings,
    pub(super) progress: &'a dyn Progress,
}

/// What was named.
pub(super) struct Name {
    pub(super) candidate: Candidate,
    /// Share of random draws in which an effect gains as much.
    pub(super) chance: f64,
    pub(super) rivals: Vec<Rival>,
}

impl<'a> Search<'a> {
    fn scene(&self, mut fitted: Vec<Fitted>, effects: EffectSet) -> Scene<'a> {
        let held_out = fitted.split_off(self.count);
        let (here, there) = self.problems.split_at(self.count);
        Scene {
            fitted: here.iter().zip(fitted).collect(),
            held_out: there.iter().zip(held_out).collect(),
            effects,
            tolerances: self.settings.tolerances,
        }
    }

    /// Tells about what share is done where so many effects were tried, and a share of the next one.
    fn reached(&self, tried: usize, share: f64) {
        let left =
            |tried: usize| (1.0 - ERRORS) * ANOTHER.powi(i32::try_from(tried).unwrap_or(i32::MAX));
        let (from, to) = (left(tried), left(tried + 1));
        self.progress.reached(1.0 - from + (from - to) * share);
    }

    fn run(&self, alone: Vec<Alone>) -> Result<Report> {
        let none = EffectSet::new();
        let (files, settled): (Vec<Fitted>, Vec<Fitted>) = alone
            .into_iter()
            .map(|alone| (alone.around_files, alone.settled))
            .unzip();
        let unadjusted = unadjusted(files.get(..self.count).unwrap_or(&files));
        let files = self.scene(files, none.clone());
        let mut scene = self.scene(settled, none);
        let mut plain: Option<Vec<Errors>> = None;
        let mut names: Vec<Name> = Vec::new();
        let mut bare: Option<Scene<'a>> = None;
        let mut nearest: Option<Name> = None;
        let mut out_of_question: Vec<Effect> = Vec::new();
        while names.len() < self.settings.max_effects && out_of_question.len() < TRIED {
            begin(self.progress, "which effect explains most")?;
            let tried = names.len() + out_of_question.len();
            // Constants may do most of what is missing once they are fitted, so the first name is sought around the files;
            // but far from the files slopes may be others.
            let scenes = [&files, &scene];
            let mut found = None;
            for from in scenes.into_iter().skip(names.len().min(1)) {
                let candidates = from.candidates(&out_of_question, self.progress)?;
                let chance = from.chance(self.settings.seed);
                let Some(name) = self.best(&candidates, &chance) else {
                    continue;
                };
                let promises = promises(&name.candidate, &chance);
                if promises || found.is_none() {
                    found = Some((name, chance, from, promises));
                }
                if promises {
                    break;
                }
            }
            self.reached(tried, 0.3);
            let Some((mut name, chance, from, promises)) = found else {
                break;
            };
            if !promises {
                nearest = Some(name);
                break;
            }
            let what = name.candidate.effect.description().name;
            begin(self.progress, &format!("errors beside {what}"))?;
            let next = self.with(&scene, from, &name.candidate)?;
            self.reached(tried, 1.0);
            if let Some(next) = next {
                name.candidate = self.compared(&scene, &next, &name.candidate);
                if self.deserves(&name.candidate, &chance) {
                    if plain.is_none() {
                        plain = self.quiet(&scene)?;
                    }
                    bare.get_or_insert(core::mem::replace(&mut scene, next));
                    names.push(name);
                    continue;
                }
            }
            out_of_question.push(name.candidate.effect);
            nearest.get_or_insert(name);
        }
        begin(self.progress, "what is left")?;
        let report = self.report(&scene, plain, unadjusted, names, nearest)?;
        if report.verdict != Outcome::Unexplained {
            return Ok(report);
        }
        described(bare.as_ref().unwrap_or(&scene), report, self.progress)
    }

    /// Everything refitted beside a candidate. `from` is the scene in which it was found.
    ///
    /// Constants may absorb most of an effect, and a fit started from a weak effect may end in that local minimum. So a
    /// stronger start is tried too.
    fn with(
        &self,
        scene: &Scene<'a>,
        from: &Scene<'a>,
        candidate: &Candidate,
    ) -> Result<Option<Scene<'a>>> {
        let mut best: Option<(f64, Vec<Fitted>, EffectSet)> = None;
        for share in STARTS {
            let start = candidate.stretched(share);
            if let Some((fitted, effects)) = self.settled(scene, from, start, candidate.effect)? {
                let likelihood: f64 = fitted.iter().map(|fitted| fitted.errors.likelihood).sum();
                if best.as_ref().is_none_or(|(least, ..)| likelihood > *least) {
                    best = Some((likelihood, fitted, effects));
                }
            }
        }
        let Some((_, mut fitted, effects)) = best else {
            return Ok(None);
        };
        let held_out = self.problems.iter().skip(self.count);
        for (problem, (_, alone)) in held_out.zip(&scene.held_out) {
            let belief = Belief {
                effects: effects.clone(),
                ..Belief::files()
            };
            match problem.fit(&belief, Some(&alone.errors), 2, self.progress)? {
                Some(fit) => fitted.push(fit),
                None => return Ok(None),
            }
        }
        Ok(Some(self.scene(fitted, effects)))
    }

    /// Errors and effects fitted in turn until neither moves, in the flights that are fitted.
    fn settled(
        &self,
        scene: &Scene<'a>,
        from: &Scene<'a>,
        mut effects: EffectSet,
        effect: Effect,
    ) -> Result<Option<(Vec<Fitted>, EffectSet)>> {
        let mut beliefs: Vec<Belief> = from
            .fitted
            .iter()
            .map(|(_, fitted)| Belief {
                effects: effects.clone(),
                ..fitted.belief.clone()
            })
            .collect();
        let mut errors: Vec<Errors> = scene
            .fitted
            .iter()
            .map(|(_, fitted)| fitted.errors.clone())
            .collect();
        let mut best = None;
        for round in 0..ROUNDS {
            let mut fitted = Vec::new();
            for ((problem, belief), errors) in self.problems.iter().zip(&beliefs).zip(&errors) {
                match problem.fit(belief, Some(errors), 1, self.progress)? {
                    Some(fit) => fitted.push(fit),
                    None => return Ok(best),
                }
            }
            let here = Scene {
                fitted: self.problems.iter().zip(fitted).collect(),
                held_out: Vec::new(),
                effects: effects.clone(),
                tolerances: self.settings.tolerances,
            };
            let next = here.followed(&effects, effect, self.progress);
            check(self.progress)?;
            let fitted: Vec<Fitted> = here.fitted.into_iter().map(|(_, fitted)| fitted).collect();
            errors = fitted.iter().map(|fitted| fitted.errors.clone()).collect();
            let Some(next) = next else {
                return Ok(Some((fitted, effects)));
            };
            let moved = next.moved_from(&effects);
            let here = effects.clone();
            effects = next.effects;
            for (belief, fitted) in beliefs.iter_mut().zip(&fitted) {
                *belief = fitted.belief_with(&effects);
            }
            best = Some((fitted, here));
            if moved < SETTLED && round > 0 {
                break;
            }
        }
        Ok(best)
    }

    /// The candidate with its gain once everything is fitted with and without it.
    fn compared(&self, without: &Scene<'_>, with: &Scene<'_>, candidate: &Candidate) -> Candidate {
        let gains =
            |before: &[(&Problem<'_>, Fitted)], after: &[(&Problem<'_>, Fitted)]| -> Vec<f64> {
                let likelihoods = before.iter().zip(after);
                likelihoods
                    .map(|((_, a), (_, b))| b.errors.likelihood - a.errors.likelihood)
                    .collect()
            };
        Candidate {
            effects: with.effects.clone(),
            gain: gains(&without.fitted, &with.fitted).iter().sum(),
            gains_held_out: gains(&without.held_out, &with.held_out),
            ..candidate.clone()
        }
    }

    /// The best candidate that matters, with those that are equally good.
    fn best(&self, candidates: &[Candidate], chance: &[f64]) -> Option<Name> {
        let material = |candidate: &&Candidate| {
            let values = candidate.values();
            let parameters = candidate.effect.description().parameters;
            parameters.iter().zip(values).any(|(parameter, value)| {
                let half = 0.5 * (parameter.high - parameter.low);
                (value - parameter.neutral).abs() > MATERIAL * half
            })
        };
        let best = candidates.iter().find(material)?;
        let rivals = candidates
            .iter()
            .filter(|other| other.effect != best.effect && other.is_rival_of(best))
            .map(|other| Rival {
                name: other.effect.description().name,
                share: other.total() / best.total(),
            });
        let above = chance
            .iter()
            .filter(|draw| **draw >= best.deviations())
            .count();
        Some(Name {
            rivals: rivals.collect(),
            chance: (above + 1) as f64 / (chance.len() + 1) as f64,
            candidate: best.clone(),
        })
    }

    fn deserves(&self, candidate: &Candidate, chance: &[f64]) -> bool {
        let votes = candidate.gains_held_out.iter().all(|gain| *gain > VOTE);
        let least = if candidate.gains_held_out.is_empty() {
            LEAST_ALONE
        } else {
            LEAST.max(quantile_of_sorted(chance, 0.99) + BEYOND_CHANCE)
        };
        votes && candidate.deviations() > least && candidate.total() > ALL_TOGETHER
    }

    /// Errors of the flights that are fitted where nothing pushes.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn quiet(&self, scene: &Scene<'_>) -> Result<Option<Vec<Errors>>> {
        let each = scene.fitted.iter();
        each.map(|(problem, fitted)| without_push(problem, fitted, self.progress))
            .collect()
    }
}
