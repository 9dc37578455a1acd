//! The search: errors are estimated first, then an effect is named if the flights, including those held out, are much
//! more likely with it than without it.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};

use super::candidate::Candidate;
use super::contest::Scene;
use super::description::described;
use super::effect_set::EffectSet;
use super::error::{Error, Result};
use super::error_bars::Estimates;
use super::error_model::Errors;
use super::fitted::Fitted;
use super::linearization::Belief;
use super::nuisance::Tolerances;
use super::problem::Problem;
use super::progress::{Progress, begin};
use super::remainder::{unadjusted, without_push};
use super::report::{Outcome, Report, Rival};
use super::statistics::quantile_of_sorted;
use super::stretch::first_frames;
use super::track::Track;

/// Settings of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Maximum number of effects to name.
    pub max_effects: usize,
    /// Seed of the random draws.
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

/// Minimum duration of a flight (stretches, s).
const SHORTEST: usize = 2;
const LEAST_S: f64 = 4.0;

/// Standard deviations by which a named effect must exceed the 99th percentile of the null distribution, and the least
/// significance in any case.
const BEYOND_CHANCE: f64 = 1.0;
const LEAST: f64 = 4.5;
/// Half the width of intervals that contain all of one, two or three parameters in 95 % of flights (standard errors).
const INTERVALS: [f64; 3] = [1.96, 2.24, 2.39];
/// Least significance without a held-out flight.
const LEAST_ALONE: f64 = 7.0;

/// Gain required in each held-out flight, and in all flights together after the cost of the parameters.
pub(super) const VOTE: f64 = 2.0;
pub(super) const ALL_TOGETHER: f64 = 12.0;

/// Difference of log-likelihood that is too small to rank effects.
const EQUAL: f64 = 0.5;

/// Number of rejected effects after which the search ends.
const TRIED: usize = 3;

/// Share of the progress taken by the errors, and share of the remaining progress left after each effect.
const ERRORS: f64 = 0.4;
const ANOTHER: f64 = 0.3;

/// Searches for effects that the model lacks in flights of one subject. The flights in `held_out` are not fitted, but
/// must confirm the result.
///
/// # Errors
/// Returns an error if a flight is too short, or if the search was cancelled.
pub fn discover(
    flights: &[Track],
    held_out: &[Track],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Report> {
    begin(progress, "sensor noise")?;
    let problem = |track: &Track| -> Result<()> {
        let found_s = track.duration();
        let least_s = LEAST_S;
        if first_frames(track).count() < SHORTEST {
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

/// A flight fitted as if the model lacked nothing.
struct Alone {
    /// Linearized around the files, so that fitted constants cannot hide a missing effect.
    around_files: Fitted,
    /// Linearized around the flight's own constants.
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
        let first = problem.first(progress)?.ok_or(too_short)?;
        problem.weigh(&first);
        let around_files = problem
            .fit(&first.belief_wandering(), Some(&first.errors), 1, progress)?
            .ok_or(too_short)?;
        let belief = around_files.belief_with(&EffectSet::new());
        // If the simulation diverges with the fitted constants, those of the files are kept.
        let settled = match problem.fit(&belief, Some(&around_files.errors), 1, progress)? {
            Some(settled) => settled,
            None => problem
                .fit(&files, Some(&around_files.errors), 1, progress)?
                .ok_or(too_short)?,
        };
        Ok(Self {
            around_files,
            settled: problem.converged(settled, progress)?,
        })
    }
}

/// Whether a candidate is worth refitting everything with it. The threshold is lower than for a name, because errors
/// fitted without the effect may have absorbed part of it.
fn promises(candidate: &Candidate, chance: &[f64]) -> bool {
    let least = quantile_of_sorted(chance, 0.99);
    let is_confirmed = candidate.deviations_together() > LEAST.max(least + BEYOND_CHANCE);
    candidate.promise() > 0.0 && (candidate.deviations() > least || is_confirmed)
}

/// A search in flights whose errors have been fitted without any effect.
pub(super) struct Search<'a> {
    pub(super) problems: &'a [Problem<'a>],
    /// Number of fitted flights; the others are held out.
    pub(super) count: usize,
    pub(super) settings: &'a Settings,
    pub(super) progress: &'a dyn Progress,
}

/// A named effect.
pub(super) struct Name {
    pub(super) candidate: Candidate,
    /// Share of random draws in which some effect gains as much.
    pub(super) chance: f64,
    pub(super) rivals: Vec<Rival>,
}

impl Name {
    /// Adds those of the rejected candidates as rivals that gain as much in the fitted flights: held-out flights alone
    /// speak against them.
    fn contest(&mut self, rejected: &[Candidate]) {
        let as_good = |other: &&Candidate| other.gains_as_much_as(&self.candidate);
        let rivals = rejected.iter().filter(as_good);
        let rivals = rivals.map(|other| Rival::new(other, &self.candidate));
        self.rivals.extend(rivals);
    }
}

/// A candidate that was not named.
pub(super) struct Rejected {
    pub(super) name: Name,
    /// Standard errors of the effects fitted with it.
    pub(super) errors: EffectSet,
    /// Whether it was significant before subject, coefficients and joints were adjusted, so that it may be the cause of
    /// these adjustments.
    pub(super) is_alternative: bool,
}

/// The best candidate, and the candidates from which it was chosen.
pub(super) struct Found {
    pub(super) name: Name,
    /// Best first.
    pub(super) candidates: Vec<Candidate>,
    pub(super) chance: Vec<f64>,
    /// Whether it was found around the files rather than around the flights' own constants.
    pub(super) around_files: bool,
    promises: bool,
}

/// The best candidate that matters. Among equals, the first in the library.
fn best(candidates: &[Candidate], chance: &[f64]) -> Option<Name> {
    let first = candidates.iter().find(|candidate| candidate.matters())?;
    let equals = candidates
        .iter()
        .filter(|other| other.matters() && other.promise() > first.promise() - EQUAL);
    let best = equals.min_by_key(|candidate| candidate.effect)?;
    let above = chance
        .iter()
        .filter(|draw| **draw >= best.deviations())
        .count();
    Some(Name {
        rivals: Vec::new(),
        chance: (above + 1) as f64 / (chance.len() + 1) as f64,
        candidate: best.clone(),
    })
}

/// Whether the parameters of the last effect differ from neutral by more than their standard errors allow, which are
/// wider than the gain suggests if stretches or flights disagree. What the first effect leaves may look like another, so
/// further effects must be clear.
fn stands(all_flights: &Estimates, named: usize) -> bool {
    let Estimates { effects, errors } = all_flights;
    let (Some(effect), Some(errors)) = (effects.last(), errors.last()) else {
        return false;
    };
    differs(effect, errors, (named > 0).then_some(LEAST))
}

/// Whether a parameter of an effect differs from neutral by more than so many standard errors; by default, whether the
/// intervals of all its parameters exclude their neutral values.
pub(super) fn differs(
    (effect, values): &(Effect, [f64; PARAMETER_COUNT]),
    (_, errors): &(Effect, [f64; PARAMETER_COUNT]),
    least: Option<f64>,
) -> bool {
    let parameters = effect.description().parameters;
    let interval = INTERVALS[parameters.len().clamp(1, INTERVALS.len()) - 1];
    let least = least.unwrap_or(interval);
    parameters
        .iter()
        .zip(values.iter().zip(errors))
        .any(|(parameter, (value, error))| (value - parameter.neutral).abs() > least * error)
}

impl<'a> Search<'a> {
    pub(super) fn scene(&self, mut fitted: Vec<Fitted>, effects: EffectSet) -> Scene<'a> {
        let held_out = fitted.split_off(self.count);
        let (here, there) = self.problems.split_at(self.count);
        Scene {
            fitted: here.iter().zip(fitted).collect(),
            held_out: there.iter().zip(held_out).collect(),
            effects,
            tolerances: self.settings.tolerances,
        }
    }

    /// Reports progress after `tried` effects and a share of the next one.
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
        let mut nearest: Option<Rejected> = None;
        let mut out_of_question: Vec<Effect> = Vec::new();
        // Candidates rejected since the last name.
        let mut rejected: Vec<Candidate> = Vec::new();
        while names.len() < self.settings.max_effects && out_of_question.len() < TRIED {
            begin(self.progress, "comparing the effects of the library")?;
            let tried = names.len() + out_of_question.len();
            // Fitted constants may have absorbed most of a missing effect, so the first effect is sought around the
            // files. The flights' own constants are tried next, because slopes may differ far from the files.
            let scenes = [&files, &scene];
            let found = self.sought(&scenes[names.len().min(1)..], &out_of_question)?;
            self.reached(tried, 0.3);
            let Some(found) = found else {
                break;
            };
            if !found.promises {
                nearest.get_or_insert(Rejected {
                    errors: found.name.candidate.standard_errors(&[]),
                    name: found.name,
                    is_alternative: false,
                });
                break;
            }
            let chance = found.chance.clone();
            let (mut name, next) = self.fitted_beside(&files, &mut scene, found)?;
            self.reached(tried, 1.0);
            let deserves = self.deserves(&name.candidate, &chance);
            let needed = next.as_ref().filter(|_| deserves || nearest.is_none());
            let bars = needed.map(|next| self.error_bars(next));
            if let (Some(next), Some(bars)) = (next, &bars)
                && deserves
                && stands(&bars.pooled, names.len())
            {
                name.contest(&core::mem::take(&mut rejected));
                if plain.is_none() {
                    plain = self.quiet(&scene)?;
                }
                bare.get_or_insert(core::mem::replace(&mut scene, next));
                names.push(name);
                scene = self.without_redundant(scene, bars.errors.clone(), &mut names)?;
                continue;
            }
            out_of_question.push(name.candidate.effect);
            rejected.push(name.candidate.clone());
            nearest.get_or_insert(Rejected {
                errors: bars
                    .map_or_else(|| name.candidate.standard_errors(&[]), |bars| bars.errors),
                is_alternative: names.is_empty(),
                name,
            });
        }
        begin(self.progress, "the remaining residual")?;
        let report = self.report(&scene, plain, unadjusted, names, nearest)?;
        match report.verdict {
            Outcome::Unexplained => self.by_description(bare.unwrap_or(scene), report),
            // Loads and inputs that change fast may look like errors of the suit.
            Outcome::Calibrated if !self.scored(&scene).is_empty() => {
                self.by_description(scene, report)
            }
            _ => Ok(report),
        }
    }

    /// Describes what no effect with a value explains, or names an effect that changes at random. `bare` is the scene
    /// without effects.
    fn by_description(&self, bare: Scene<'a>, report: Report) -> Result<Report> {
        let report = described(&bare, report, self.progress)?;
        if report.verdict == Outcome::Described {
            Ok(report)
        } else {
            self.by_strength(bare, report)
        }
    }

    /// The best candidate in the first of several scenes in which it looks promising.
    fn sought(&self, scenes: &[&Scene<'a>], out_of_question: &[Effect]) -> Result<Option<Found>> {
        let mut found = None;
        for (place, from) in scenes.iter().enumerate() {
            let candidates = from.candidates(out_of_question, self.progress)?;
            let chance = from.chance(self.settings.seed);
            let Some(name) = best(&candidates, &chance) else {
                continue;
            };
            let promises = promises(&name.candidate, &chance);
            if promises || found.is_none() {
                found = Some(Found {
                    name,
                    candidates,
                    chance,
                    around_files: scenes.len() > 1 && place == 0,
                    promises,
                });
            }
            if promises {
                break;
            }
        }
        Ok(found)
    }

    /// Whether a candidate gains enough to be named.
    pub(super) fn deserves(&self, candidate: &Candidate, chance: &[f64]) -> bool {
        let votes = candidate.gains_held_out.iter().all(|gain| *gain > VOTE);
        let beyond_chance = quantile_of_sorted(chance, 0.99);
        let least = if candidate.gains_held_out.is_empty() {
            LEAST_ALONE
        } else {
            LEAST.max(beyond_chance + BEYOND_CHANCE)
        };
        let gains =
            votes && candidate.deviations_together() > least && candidate.total() > ALL_TOGETHER;
        gains && candidate.matters()
    }

    /// Errors of the fitted flights without unknown forces and moments.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn quiet(&self, scene: &Scene<'_>) -> Result<Option<Vec<Errors>>> {
        let each = scene.fitted.iter();
        each.map(|(problem, fitted)| without_push(problem, fitted, self.progress))
            .collect()
    }
}
