//! Competitors nearly as good as the best candidate are refitted as well, and a better one replaces it.

use super::candidate::Candidate;
use super::contest::Scene;
use super::effect_set::EffectSet;
use super::error::Result;
use super::fitted::Fitted;
use super::problem::Problem;
use super::progress::begin;
use super::report::Rival;
use super::search::{Name, Search};

/// Share of the best gain above which a competitor is refitted too, the difference that a first-order estimate may be
/// wrong by, and how many competitors are refitted.
const CHALLENGES: f64 = 0.4;
const CLOSE: f64 = 25.0;
pub(super) const CHALLENGERS: usize = 4;

/// Share of the best gain by which a competitor may be worse before its own slopes are computed.
const NEARLY: f64 = 0.05;

/// A competitor is dropped if the fitted flights are less likely with it by more than this, and by more than this share
/// of the best gain: converging fits change by tens.
const HOPELESS: f64 = 100.0;
const HOPELESS_SHARE: f64 = 0.3;

/// A candidate with the flights fitted together with it.
struct Challenger<'a> {
    candidate: Candidate,
    scene: Scene<'a>,
}

/// Candidates that seem good enough to be compared with `one`.
pub(super) fn challenging(candidates: &[Candidate], one: &Candidate) -> Vec<Candidate> {
    let best = one.promise();
    let least = f64::min(CHALLENGES * best, best - CLOSE).max(0.0);
    let others = candidates
        .iter()
        .filter(|other| other.effect != one.effect && other.matters() && other.promise() > least);
    others.take(CHALLENGERS).cloned().collect()
}

impl<'a> Search<'a> {
    /// Refits the competitors of the candidate that was found. A better one replaces it, equally good ones become its
    /// rivals.
    pub(super) fn challenge(
        &self,
        scene: &Scene<'a>,
        next: &mut Scene<'a>,
        name: &mut Name,
        mut others: Vec<Candidate>,
    ) -> Result<()> {
        let mut beaten: Vec<Candidate> = Vec::new();
        loop {
            let mut tried = self.challengers(scene, next, &others)?;
            // The best was fitted with slopes of its own, so one that is close without them gets the same chance.
            let total = name.candidate.total();
            let is_close =
                |other: &Challenger<'_>| other.candidate.total() > total * (1.0 - NEARLY);
            if tried.first().is_some_and(is_close) {
                let best = tried.swap_remove(0);
                let before = best.candidate.clone();
                others.retain(|other| other.effect != before.effect);
                if let Some(with) = self.finished(best)? {
                    let best = before.compared(scene, &with);
                    if best.replaces(&name.candidate) {
                        beaten.push(core::mem::replace(&mut name.candidate, best));
                        *next = with;
                        continue;
                    }
                    beaten.push(best);
                }
            }
            let best = &name.candidate;
            let rivals = tried
                .iter()
                .map(|other| &other.candidate)
                .chain(&beaten)
                .filter(|other| other.effect != best.effect && other.is_rival_of(best));
            name.rivals = rivals.map(|other| Rival::new(other, best)).collect();
            return Ok(());
        }
    }

    /// Log-likelihood of the fitted flights below which a competitor is dropped.
    fn hopeless(&self, scene: &Scene<'a>, next: &Scene<'a>) -> f64 {
        let best = next.likelihood();
        best - f64::max(HOPELESS, HOPELESS_SHARE * (best - scene.likelihood()))
    }

    /// Competitors after refitting, best first.
    fn challengers(
        &self,
        scene: &Scene<'a>,
        next: &Scene<'a>,
        others: &[Candidate],
    ) -> Result<Vec<Challenger<'a>>> {
        let mut tried = Vec::new();
        for other in others {
            let what = other.effect.description().name;
            begin(self.progress, &format!("errors beside {what}"))?;
            if let Some(other) = self.challenged(scene, next, other)? {
                tried.push(other);
            }
        }
        tried.sort_by(|a, b| b.candidate.total().total_cmp(&a.candidate.total()));
        Ok(tried)
    }

    /// Refits everything together with a competitor, using the slopes of the best candidate's fit.
    fn challenged(
        &self,
        scene: &Scene<'a>,
        next: &Scene<'a>,
        other: &Candidate,
    ) -> Result<Option<Challenger<'a>>> {
        let of = |flights: &[(&Problem<'a>, Fitted)], effects: &EffectSet| {
            let each = flights.iter().map(|(problem, fitted)| {
                let belief = fitted.belief_with(effects);
                problem.fit_with_slopes_of(fitted, &belief, self.progress)
            });
            each.collect::<Result<Option<Vec<Fitted>>>>()
        };
        let settled =
            |(problem, fitted): (&Problem<'a>, Fitted)| problem.settled(fitted, self.progress);
        let Some(first) = of(&next.fitted, &other.effects)? else {
            return Ok(None);
        };
        let round = self.round(first, other.effects.clone())?;
        let round = self.with_same_slopes(round)?;
        if round.likelihood() < self.hopeless(scene, next) {
            return Ok(None);
        }
        let (fitted, effects) = (round.fitted, round.effects);
        let Some(held_out) = of(&next.held_out, &effects)? else {
            return Ok(None);
        };
        let each = self.problems.iter().zip(fitted.into_iter().chain(held_out));
        let fitted = each.map(settled).collect::<Result<Vec<_>>>()?;
        let with = self.scene(fitted, effects);
        Ok(Some(Challenger {
            candidate: other.compared(scene, &with),
            scene: with,
        }))
    }

    /// Recomputes the slopes of a competitor that was fitted with those of another candidate.
    fn finished(&self, challenger: Challenger<'a>) -> Result<Option<Scene<'a>>> {
        let scene = challenger.scene;
        let fitted = scene.fitted.into_iter().map(|(_, fitted)| fitted);
        let round = self.round(fitted.collect(), scene.effects)?;
        let (mut fitted, effects) = self.with_new_slopes(round)?;
        for (problem, fit) in &scene.held_out {
            let belief = fit.belief_with(&effects);
            let Some(fit) = problem.fit(&belief, Some(&fit.errors), 1, self.progress)? else {
                return Ok(None);
            };
            fitted.push(problem.settled(fit, self.progress)?);
        }
        Ok(Some(self.scene(fitted, effects)))
    }
}
