//! Names effects that change at random, by their strengths, in flights that nothing else explains.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::DMatrix;

use super::candidate::Candidate;
use super::contest::Scene;
use super::effect_set::EffectSet;
use super::error::Result;
use super::fitted::Fitted;
use super::problem::Problem;
use super::progress::{begin, check};
use super::remainder::without_push;
use super::report::{Outcome, Report};
use super::search::{ALL_TOGETHER, Name, Search, VOTE};
use super::spectrum::{TRIED, likelihood_of_loads, scores, standard_errors, strengths};

/// Standard deviations that the slope at zero strength must exceed for an effect to be fitted: in fitted and in
/// held-out flights.
const SCORED: f64 = 3.0;
const SCORED_HELD_OUT: f64 = 1.5;

/// Number of alternating fits of the strengths and of everything else.
const ROUNDS: usize = 2;

/// Share of the best slope above which another effect is fitted too.
const CLOSE: f64 = 0.5;

/// A named effect, and the flights fitted with it.
type Fit<'a> = (Candidate, Scene<'a>);

fn flights<'s, 'a>(scene: &'s Scene<'a>) -> Vec<(&'a Problem<'a>, &'s Fitted)> {
    let each = scene.fitted.iter();
    each.map(|(problem, fitted)| (*problem, fitted)).collect()
}

impl<'a> Search<'a> {
    /// Names an effect that changes at random in flights that neither values nor a description explain, or lists it as
    /// the nearest.
    ///
    /// A random process explains a part of any load, so it must leave nothing for unknown loads to explain, and the
    /// flights must be more likely with it alone than with anything else that was tried.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn by_strength(&self, mut scene: Scene<'a>, report: Report) -> Result<Report> {
        begin(self.progress, "what changes at random")?;
        let mut best: Option<Fit<'a>> = None;
        for effect in self.scored(&scene) {
            let what = effect.0.description().name;
            begin(self.progress, &format!("errors beside {what}"))?;
            let Some(fit) = self.beside_strength(&scene, effect)? else {
                continue;
            };
            let total = fit.0.total();
            if best.as_ref().is_none_or(|(best, _)| total > best.total()) {
                best = Some(fit);
            }
        }
        let Some((candidate, next)) = best else {
            return Ok(report);
        };
        self.retry_without(&mut scene, &next)?;
        let candidate = candidate.compared(&scene, &next);
        let deserves = self.deserves(&candidate, &[]);
        let stands_out = deserves && self.stands_out(&scene, &next, &report)?;
        // Chernoff's bound for a normal variable, times the number of effects tried.
        let chance = TRIED.len() as f64 * (-0.5 * candidate.deviations().powi(2)).exp();
        let name = Name {
            candidate,
            chance: chance.min(1.0),
            rivals: Vec::new(),
        };
        let plain = self.quiet(&scene)?;
        let unadjusted = report.misfit_unadjusted;
        let mut named = self.report(&next, plain, unadjusted, vec![name], None)?;
        let is_left = named.remainders.iter().any(|left| left.is_unexplained);
        if stands_out && !is_left && named.verdict == Outcome::Named {
            return Ok(named);
        }
        let mut report = report;
        if deserves {
            report.nearest.append(&mut named.effects);
            report.nearest.append(&mut named.nearest);
        }
        Ok(report)
    }

    /// Whether flights are more likely with an effect and no unknown load than with unknown loads that change within
    /// tenths of a second, with loads that change more slowly, and, for the first flight, with the nearest description.
    fn stands_out(&self, before: &Scene<'a>, next: &Scene<'a>, report: &Report) -> Result<bool> {
        let described = report.nearest_description.as_ref();
        let described = described.map_or(0.0, |nearest| (nearest.gain - nearest.cost).max(0.0));
        let (mut gain, mut gain_over_loads) = (0.0, 0.0);
        let flights = before.fitted.iter().chain(&before.held_out);
        let next = next.fitted.iter().chain(&next.held_out);
        for (k, ((_, plain), (problem, fitted))) in flights.zip(next).enumerate() {
            let quiet = without_push(problem, fitted, self.progress)?;
            // The loads are tried around the fits with and without the effect, so that neither has an advantage.
            let loads = [plain, fitted].map(|at| likelihood_of_loads(problem, at, self.progress));
            check(self.progress)?;
            let (Some(quiet), [Some(here), Some(there)]) = (quiet, loads) else {
                return Ok(false);
            };
            let loads = here.max(there);
            let own = quiet.likelihood - plain.errors.likelihood;
            if own < VOTE || (k == 0 && own < described + ALL_TOGETHER) {
                return Ok(false);
            }
            gain += own;
            gain_over_loads += quiet.likelihood - loads;
        }
        Ok(gain > ALL_TOGETHER && gain_over_loads > ALL_TOGETHER)
    }

    /// Effects that are worth fitting, best first.
    pub(super) fn scored(&self, scene: &Scene<'a>) -> EffectSet {
        let tried: EffectSet = TRIED.to_vec();
        let of = |flights: &[(&Problem<'_>, Fitted)]| -> Vec<Vec<f64>> {
            let each = flights.iter();
            each.map(|(problem, fitted)| scores(problem, fitted, &tried))
                .collect()
        };
        let (here, there) = (of(&scene.fitted), of(&scene.held_out));
        let least = |scores: &[Vec<f64>], k: usize| {
            scores
                .iter()
                .map(|scores| scores[k])
                .fold(f64::INFINITY, f64::min)
        };
        let mut scored: Vec<(f64, _)> = tried
            .iter()
            .enumerate()
            .filter(|(k, _)| least(&here, *k) > SCORED && least(&there, *k) > SCORED_HELD_OUT)
            .map(|(k, effect)| (least(&here, k), *effect))
            .collect();
        scored.sort_by(|a, b| b.0.total_cmp(&a.0));
        let best = scored.first().map_or(0.0, |(score, _)| *score);
        scored.retain(|(score, _)| *score > CLOSE * best);
        scored.into_iter().map(|(_, effect)| effect).collect()
    }

    /// Refits everything together with an effect, including its strengths.
    fn beside_strength(
        &self,
        scene: &Scene<'a>,
        (effect, tried): (Effect, [f64; PARAMETER_COUNT]),
    ) -> Result<Option<Fit<'a>>> {
        let mut effects = scene.effects.clone();
        effects.push((effect, tried));
        let mut fits = Vec::new();
        for (problem, alone) in &scene.fitted {
            let (belief, errors) = (alone.start_with(&effects), alone.plausible_errors());
            let Some(fit) = problem.fit(&belief, errors, 1, self.progress)? else {
                return Ok(None);
            };
            fits.push((*problem, fit));
        }
        for _ in 0..ROUNDS {
            let flights: Vec<_> = fits.iter().map(|(problem, fit)| (*problem, fit)).collect();
            let Some(own) = effects.iter_mut().find(|(known, _)| *known == effect) else {
                return Ok(None);
            };
            let found = strengths(&flights, effect, &own.1, self.progress);
            check(self.progress)?;
            let Some(values) = found else {
                return Ok(None);
            };
            own.1 = values;
            for (problem, fit) in &mut fits {
                let belief = fit.belief_with(&effects);
                let Some(next) = problem.fit(&belief, Some(&fit.errors), 1, self.progress)? else {
                    return Ok(None);
                };
                *fit = next;
            }
        }
        let mut all = Vec::new();
        for (problem, fit) in fits {
            all.push(problem.settled(fit, self.progress)?);
        }
        let Some(next) = self.with_held_out(all, scene, effects.clone())? else {
            return Ok(None);
        };
        let candidate = Candidate {
            effect,
            effects,
            covariance: DMatrix::zeros(0, 0),
            gain: 0.0,
            gains_held_out: Vec::new(),
        };
        Ok(Some((candidate.compared(scene, &next), next)))
    }

    /// Standard errors of the strengths of an effect in a scene.
    pub(super) fn errors_of_strength(
        &self,
        scene: &Scene<'a>,
        effect: Effect,
        values: &[f64; PARAMETER_COUNT],
    ) -> [f64; PARAMETER_COUNT] {
        let found = standard_errors(&flights(scene), effect, values);
        found.unwrap_or([0.0; PARAMETER_COUNT])
    }
}
