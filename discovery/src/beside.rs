//! Refits all errors together with an effect, and once more without it.

use super::candidate::Candidate;
use super::challenge::{CHALLENGERS, challenging};
use super::contest::{Scene, precision};
use super::effect_set::{EffectSet, between, furthest, moved, parameters_of};
use super::error::Result;
use super::error_model::Errors;
use super::fitted::Fitted;
use super::linearization::Belief;
use super::problem::{AGAIN, Problem};
use super::progress::{begin, check};
use super::search::{Found, Name, Search};
use super::whitened::Quadratic;

/// Maximum number of iterations with fixed slopes, the step at which they have converged (standard errors), and how
/// often the slopes are recomputed: usually, and at most while the flights gain from it.
const ROUNDS: usize = 8;
const SETTLED: f64 = 0.4;
const SLOPES: usize = 3;
const SLOPES_AT_MOST: usize = 10;

/// Change of the log-likelihood that justifies another step (or, for a loss, half a step), and how often a step is
/// halved.
const WORTH: f64 = 2.0;
const HALVED: usize = 3;

/// Initial strengths of an effect, relative to its first-order estimate: two around the constants with which the effect
/// was found, one around those of the flights without it.
const STARTS: [f64; 3] = [1.0, 2.2, 1.0];

/// Gain from refitting the flights without an effect above which the choice of effect is reconsidered.
const RETHOUGHT: f64 = 10.0;

/// Flights fitted around given effects.
pub(super) struct Round {
    pub(super) fitted: Vec<Fitted>,
    pub(super) effects: EffectSet,
    /// Effects after the next step, and the size of that step (standard errors).
    next: EffectSet,
    moved: f64,
}

impl Round {
    pub(super) fn likelihood(&self) -> f64 {
        self.fitted.iter().map(|fit| fit.errors.likelihood).sum()
    }

    /// The more likely of two rounds. Likelihoods vary by a few units between points of linearization, so the last
    /// round is not always the best.
    fn or_likelier(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if other.likelihood() > self.likelihood() => other,
            _ => self,
        }
    }

    /// The fitted errors with the effects of the next step.
    fn beliefs(&self) -> Vec<Belief> {
        let each = self.fitted.iter();
        each.map(|fitted| fitted.belief_with(&self.next)).collect()
    }

    fn errors(&self) -> Vec<Option<&Errors>> {
        self.fitted.iter().map(|fit| Some(&fit.errors)).collect()
    }
}

impl<'a> Search<'a> {
    /// Refits everything together with a candidate. `from` is the scene in which it was found.
    ///
    /// Constants may absorb most of an effect, and a fit that starts from a weak effect may end in that local minimum.
    /// A stronger start is therefore tried too.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    fn with(
        &self,
        scene: &Scene<'a>,
        from: &Scene<'a>,
        candidate: &Candidate,
    ) -> Result<Option<Scene<'a>>> {
        let mut best: Option<Round> = None;
        for (share, from) in STARTS.into_iter().zip([from, from, scene]) {
            let start = candidate.stretched(share);
            let beliefs: Vec<Belief> = from
                .fitted
                .iter()
                .map(|(_, fitted)| fitted.start_with(&start))
                .collect();
            let first = match &best {
                None => {
                    let alone = scene.fitted.iter();
                    let errors = alone.map(|(_, fitted)| fitted.plausible_errors());
                    self.fitted(&beliefs, &errors.collect::<Vec<_>>())?
                }
                Some(best) => self.fitted_with_slopes(&best.fitted, &beliefs)?,
            };
            let Some(first) = first else {
                continue;
            };
            let round = self.with_same_slopes(self.round(first, start)?)?;
            if best
                .as_ref()
                .is_none_or(|best| round.likelihood() > best.likelihood())
            {
                best = Some(round);
            }
        }
        let Some(round) = best else {
            return Ok(None);
        };
        let (fitted, effects) = self.with_new_slopes(round)?;
        self.with_held_out(fitted, scene, effects)
    }

    /// The scene of fitted flights and effects, with the held-out flights of `before` fitted beside these effects.
    pub(super) fn with_held_out(
        &self,
        mut fitted: Vec<Fitted>,
        before: &Scene<'a>,
        effects: EffectSet,
    ) -> Result<Option<Scene<'a>>> {
        for (problem, alone) in &before.held_out {
            let Some(fit) = self.held_out_beside(problem, alone, &effects)? else {
                return Ok(None);
            };
            fitted.push(fit);
        }
        Ok(Some(self.scene(fitted, effects)))
    }

    /// Fits the errors of a held-out flight together with given effects.
    ///
    /// Constants fitted without the effects may have absorbed part of them, and the constants of the files may be far
    /// from those of the flight. Both starts are tried, and the more likely fit is kept.
    fn held_out_beside(
        &self,
        problem: &Problem<'a>,
        alone: &Fitted,
        effects: &EffectSet,
    ) -> Result<Option<Fitted>> {
        let files = Belief {
            effects: effects.clone(),
            ..Belief::files()
        };
        let starts = [
            problem.fit(&files, alone.plausible_errors(), 1, self.progress)?,
            problem.fit_with_slopes_of(alone, &alone.belief_with(effects), self.progress)?,
        ];
        let mut best: Option<Fitted> = None;
        for start in starts.into_iter().flatten() {
            let start = problem.settled(start, self.progress)?;
            let likelihood = start.errors.likelihood;
            if best
                .as_ref()
                .is_none_or(|best| likelihood > best.errors.likelihood)
            {
                best = Some(start);
            }
        }
        let Some(mut best) = best else {
            return Ok(None);
        };
        for _ in 0..SLOPES_AT_MOST {
            let before = best.errors.likelihood;
            let belief = best.belief_with(effects);
            let Some(next) = problem.fit(&belief, Some(&best.errors), 1, self.progress)? else {
                break;
            };
            best = problem.settled(next, self.progress)?;
            if best.errors.likelihood < before + AGAIN {
                break;
            }
        }
        Ok(Some(best))
    }

    /// Fits errors and effects with recomputed slopes until the effects converge, and returns the most likely fit.
    pub(super) fn with_new_slopes(&self, mut round: Round) -> Result<(Vec<Fitted>, EffectSet)> {
        let mut best = None;
        for times in 1..=SLOPES_AT_MOST {
            let before = round.likelihood();
            let Some(fitted) = self.fitted(&round.beliefs(), &round.errors())? else {
                break;
            };
            let next = self.round(fitted, round.next.clone())?;
            let has_settled = next.moved < SETTLED;
            let next = if has_settled {
                next
            } else {
                self.with_same_slopes(next)?
            };
            // The first round starts with slopes of another point, so its likelihood says little.
            let gained = next.likelihood() - before;
            if times > 1 && gained < -AGAIN {
                break;
            }
            let before = core::mem::replace(&mut round, next);
            if times > 1 {
                best = Some(before.or_likelier(best));
            }
            if has_settled || (times >= SLOPES && gained < AGAIN) {
                break;
            }
        }
        let round = round.or_likelier(best);
        let each = self.problems.iter().zip(round.fitted);
        let fitted = each.map(|(problem, fitted)| problem.settled(fitted, self.progress));
        Ok((fitted.collect::<Result<Vec<_>>>()?, round.effects))
    }

    /// Returns the candidate that was found, or a close competitor that proves better once everything is refitted with
    /// it, together with the flights fitted with it if that succeeds. Competitors that gain as much become its rivals.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn fitted_beside(
        &self,
        files: &Scene<'a>,
        scene: &mut Scene<'a>,
        found: Found,
    ) -> Result<(Name, Option<Scene<'a>>)> {
        let Found {
            mut name,
            candidates,
            chance,
            around_files,
            ..
        } = found;
        let what = name.candidate.effect.description().name;
        begin(self.progress, &format!("errors beside {what}"))?;
        let from = if around_files { files } else { &*scene };
        let Some(mut next) = self.with(scene, from, &name.candidate)? else {
            return Ok((name, None));
        };
        let mut others = challenging(&candidates, &name.candidate);
        name.candidate = name.candidate.compared(scene, &next);
        if !self.deserves(&name.candidate, &chance) {
            return Ok((name, Some(next)));
        }
        let first = name.candidate.effect;
        if self.retry_without(scene, &next)? > RETHOUGHT {
            // The choice was made with poorly fitted flights, so look for competitors again.
            let mut fresh = scene.candidates(&[first], self.progress)?;
            fresh.retain(|other| other.matters() && other.promise() > 0.0);
            fresh.retain(|other| others.iter().all(|known| known.effect != other.effect));
            fresh.truncate(CHALLENGERS);
            others.truncate(CHALLENGERS / 2);
            others.append(&mut fresh);
        }
        name.candidate = name.candidate.compared(scene, &next);
        self.challenge(scene, &mut next, &mut name, others)?;
        if name.candidate.effect != first {
            self.retry_without(scene, &next)?;
            name.candidate = name.candidate.compared(scene, &next);
        }
        Ok((name, Some(next)))
    }

    pub(super) fn fitted(
        &self,
        beliefs: &[Belief],
        errors: &[Option<&Errors>],
    ) -> Result<Option<Vec<Fitted>>> {
        let each = self.problems.iter().zip(beliefs).zip(errors);
        each.map(|((problem, belief), errors)| problem.fit(belief, *errors, 1, self.progress))
            .collect()
    }

    fn fitted_with_slopes(&self, of: &[Fitted], beliefs: &[Belief]) -> Result<Option<Vec<Fitted>>> {
        let each = self.problems.iter().zip(of).zip(beliefs);
        each.map(|((problem, of), belief)| problem.fit_with_slopes_of(of, belief, self.progress))
            .collect()
    }

    /// One Gauss-Newton step of the effects from a fit.
    pub(super) fn round(&self, fitted: Vec<Fitted>, effects: EffectSet) -> Result<Round> {
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        let columns: Vec<usize> = (0..parameters.len()).collect();
        let precision = precision(&self.settings.tolerances, &effects);
        let each = self.problems.iter().zip(&fitted);
        let reduced: Option<Vec<_>> = each
            .map(|(problem, fitted)| problem.slopes_here(fitted, &parameters, self.progress))
            .collect();
        check(self.progress)?;
        let solved = reduced
            .and_then(|reduced| Quadratic::joint(&reduced, &columns, &precision))
            .and_then(|here| here.solved(&Scene::prior(&effects), &Scene::from_neutral(&effects)));
        let next = solved
            .as_ref()
            .map_or_else(|| effects.clone(), |(step, _)| moved(&effects, step));
        Ok(Round {
            moved: solved.map_or(0.0, |(_, covariance)| {
                furthest(&effects, &next, &covariance)
            }),
            fitted,
            effects,
            next,
        })
    }

    /// Fits errors and effects alternately, with fixed slopes, until both converge, and returns the most likely fit.
    pub(super) fn with_same_slopes(&self, mut round: Round) -> Result<Round> {
        let (mut halved, mut gained) = (0, f64::INFINITY);
        let mut best = None;
        for _ in 0..ROUNDS {
            // While an effect is still too weak, fitted errors and hence standard errors are large, so a small step
            // alone is no sign of convergence.
            if round.moved < SETTLED && gained < WORTH {
                break;
            }
            let Some(fitted) = self.fitted_with_slopes(&round.fitted, &round.beliefs())? else {
                break;
            };
            let next = self.round(fitted, round.next.clone())?;
            gained = next.likelihood() - round.likelihood();
            if gained < -WORTH && halved < HALVED {
                halved += 1;
                round.next = between(&round.effects, &round.next);
                continue;
            }
            halved = 0;
            best = Some(core::mem::replace(&mut round, next).or_likelier(best));
        }
        Ok(round.or_likelier(best))
    }

    /// Refits the flights without the effect, starting from the errors found with it, and returns the gain. A better
    /// minimum reached this way is not due to the effect.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn retry_without(&self, scene: &mut Scene<'a>, with: &Scene<'a>) -> Result<f64> {
        let mut gained = 0.0;
        let effects = scene.effects.clone();
        let before = scene.fitted.iter_mut().chain(&mut scene.held_out);
        for ((problem, before), (_, with)) in before.zip(with.fitted.iter().chain(&with.held_out)) {
            let belief = with.belief_with(&effects);
            let Some(again) = problem.fit(&belief, Some(&with.errors), 1, self.progress)? else {
                continue;
            };
            let again = problem.settled(again, self.progress)?;
            let gain = again.errors.likelihood - before.errors.likelihood;
            if gain > 0.0 {
                gained += gain;
                *before = again;
            }
        }
        Ok(gained)
    }
}
