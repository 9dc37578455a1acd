//! Candidates for a name, fitted one after another: what is known of those before tells which are worth it.

use bodyflight_core::effect::Effect;

use super::effect_set::freedom;
use super::fit::{Data, Fit};
use super::held_out::HeldOut;
use super::linearization::Linearization;
use super::null_distribution::NullDistribution;
use super::statistics::deviations;

/// Share of the best one's gain that they must reach for the flights held out to be asked.
const IN_THE_RACE: f64 = 0.5;

/// How much more a start leaves than that of an effect that explains it all, where it is given up.
const FAR_BEHIND: f64 = 4.0;

/// A candidate, fitted with what was chosen before.
pub(super) struct Candidate {
    pub(super) effect: Effect,
    pub(super) fit: Fit,
    /// The problem linearized about that fit: what joints and subject have wrong acts differently there.
    pub(super) linearization: Linearization,
    /// What the effect gains in flights in which nothing is missing, over its parameters.
    pub(super) inflation: f64,
    /// Gains in the flights held out.
    pub(super) votes: Vec<f64>,
    /// How much it is to be preferred, by the gain in all flights together.
    pub(super) score: f64,
}

impl Candidate {
    pub(super) fn freedom(&self) -> f64 {
        freedom(self.effect)
    }

    /// By how many deviations a gain is beyond chance.
    pub(super) fn deviations(&self, gain: f64) -> f64 {
        deviations(gain / self.inflation, self.freedom())
    }

    pub(super) fn data<'a>(&'a self, data: &Data<'a>) -> Data<'a> {
        data.with(&self.linearization)
    }
}

/// An effect with its fits to several problems.
pub(super) struct Contender<'a> {
    pub(super) effect: Effect,
    /// The nearest first.
    pub(super) starts: Vec<(&'a Data<'a>, Fit)>,
}

impl Contender<'_> {
    /// Misfit that the best of its fits leaves.
    pub(super) fn nearest(&self) -> f64 {
        self.starts
            .first()
            .map_or(f64::INFINITY, |(_, fit)| fit.misfit)
    }
}

/// Contenders linearized about their own fits one after another: what is known of those before tells which are worth it.
pub(super) struct Race<'a> {
    null: &'a NullDistribution,
    /// The fit so far.
    chosen: &'a Fit,
    /// Flights held out with their misfit so far.
    voters: Vec<(&'a HeldOut<'a>, f64)>,
    /// Largest gain in this flight so far, beyond chance, that other flights do not take back.
    most: f64,
    /// Where the first that leaves little came from.
    explained_from: Option<f64>,
}

impl<'a> Race<'a> {
    pub(super) fn new(
        null: &'a NullDistribution,
        chosen: &'a Fit,
        others: &'a [HeldOut<'a>],
    ) -> Self {
        let before = |other: &'a HeldOut<'a>| (other, other.misfit(&chosen.effects));
        Self {
            null,
            chosen,
            voters: others.iter().map(before).collect(),
            most: 0.0,
            explained_from: None,
        }
    }

    /// The contender fitted, if it is in the race.
    pub(super) fn run(&mut self, contender: Contender<'_>) -> Option<Candidate> {
        let (null, chosen, little) = (self.null, self.chosen, self.null.little());
        let inflation = null.inflation_of(contender.effect);
        let mut goal = chosen.misfit - IN_THE_RACE * self.most * inflation;
        // Where one explains it all, what leaves more is no rival, and what starts far behind will leave more.
        let start = contender.nearest();
        if let Some(from) = self.explained_from {
            goal = goal.min(little);
            if start > FAR_BEHIND * from {
                return None;
            }
        }
        let (fit, linearization) = best_relinearized(contender.starts, goal)?;
        if fit.misfit > goal {
            return None;
        }
        let vote = |(other, before): &(&HeldOut<'_>, f64)| before - other.misfit(&fit.effects);
        let votes: Vec<f64> = self.voters.iter().map(vote).collect();
        let gain = chosen.misfit - fit.misfit;
        let together = gain + votes.iter().sum::<f64>();
        self.most = self.most.max(gain.min(together) / inflation);
        if chosen.misfit >= little && fit.misfit < little && self.explained_from.is_none() {
            self.explained_from = Some(start);
        }
        Some(Candidate {
            effect: contender.effect,
            score: null.score(contender.effect, together),
            fit,
            linearization,
            inflation,
            votes,
        })
    }
}

/// The best fit from some starts, the nearest first. It may end in a valley that another start leads past.
fn best_relinearized(starts: Vec<(&Data<'_>, Fit)>, goal: f64) -> Option<(Fit, Linearization)> {
    let mut best: Option<(Fit, Linearization)> = None;
    for (data, fit) in starts {
        let goal = best
            .as_ref()
            .map_or(goal, |(best, _)| best.misfit.min(goal));
        let found = data.relinearized(fit, goal);
        if best
            .as_ref()
            .is_none_or(|(best, _)| found.0.misfit < best.misfit)
        {
            best = Some(found);
        }
    }
    best
}
