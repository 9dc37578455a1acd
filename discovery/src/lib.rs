//! Finds what a flight model misses in recorded flights: where simulation and measurement disagree, which effect is
//! missing, and how much of the gap it closes.
//!
//! This crate works on flights in memory and returns reports; files, figures and commands belong to the host. Each stage
//! has its own folder and uses only those before it: the flight and the noise of its sensors ([`input`]); short
//! simulations and their residuals (`shooting`); the derivatives of the residuals with respect to everything that may be
//! wrong (`jacobian`); the size of the errors in this flight (`likelihood`); the effect that makes the flights most
//! likely (`hypotheses`); the report ([`output`]); and a load that describes what no effect explains (`unmodelled`).
//! [`discover`] runs them: it fits every flight alone, selects effects, and reports; what no effect explains is described,
//! or named if it changes at random.
#![forbid(unsafe_code)]

pub mod error;
mod hypotheses;
pub mod input;
mod jacobian;
mod likelihood;
pub mod named_effect;
pub mod output;
pub mod progress;
mod shooting;
#[cfg(test)]
mod test_subject;
#[cfg(test)]
mod tests;
mod unmodelled;

use std::borrow::Cow;

use bodyflight_core::tolerances::Tolerances;

use error::{Error, Result};
use hypotheses::decision::DECISION;
use hypotheses::forward_selection::{ERRORS, FitWithoutEffects, selected};
use hypotheses::hypothesis::NamedEffect;
use hypotheses::random_effect_test::{scored, strongest};
use hypotheses::refit::Refit;
use hypotheses::robust_covariance::error_bars;
use hypotheses::score_test::JointFit;
use input::flight::RecordedFlight;
use likelihood::flight_problem::FlightProblem;
use likelihood::variance_components::FittedErrors;
use named_effect::Outcome;
use output::report::Report;
use output::verdict::report;
use progress::{Progress, begin};
use shooting::smoothed_start::is_short;
pub use shooting::stretch::CHANNELS;
use unmodelled::search::described;

/// Settings of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Maximum number of effects to name.
    pub max_effects: usize,
    /// Tolerances of suit, subject and sensors.
    pub tolerances: Tolerances,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            max_effects: 3,
            tolerances: Tolerances::default(),
        }
    }
}

/// Joins flights that are too short to estimate their errors from each alone: they share suit and subject.
fn joined(flights: &[RecordedFlight]) -> Vec<Cow<'_, RecordedFlight>> {
    let (short, long): (Vec<_>, Vec<_>) = flights.iter().partition(|flight| is_short(flight));
    let mut all: Vec<Cow<'_, RecordedFlight>> = long.into_iter().map(Cow::Borrowed).collect();
    let first = all.len();
    for flight in short {
        let mut groups = all[first..].iter_mut();
        if !groups.any(|group| group.to_mut().join(flight)) {
            all.push(Cow::Borrowed(flight));
        }
    }
    all
}

/// Searches for effects that the model lacks in flights of one subject. The flights in `held_out` are not fitted, but
/// judge the result. Short flights are joined, also in the report, where they follow the longer ones.
///
/// # Errors
/// Returns an error if a flight is too short, or if the search was cancelled.
pub fn discover(
    flights: &[RecordedFlight],
    held_out: &[RecordedFlight],
    settings: &Settings,
    progress: &dyn Progress,
) -> Result<Report> {
    begin(progress, "sensor noise")?;
    let too_short = |found_s: f64| Error::TooShort {
        least_s: DECISION.shortest_s,
        found_s,
    };
    if flights.is_empty() {
        return Err(too_short(0.0));
    }
    let (flights, held_out) = (joined(flights), joined(held_out));
    let mut problems = Vec::new();
    for track in flights.iter().chain(&held_out) {
        let problem = FlightProblem::new(track, &settings.tolerances);
        if problem.stretches.is_empty() {
            return Err(too_short(track.duration()));
        }
        problems.push(problem);
    }
    begin(progress, "errors of suit, subject and sensors")?;
    let mut alone = Vec::new();
    let all = problems.len() as f64;
    for (k, problem) in problems.iter_mut().enumerate() {
        alone.push(FitWithoutEffects::new(problem, progress)?);
        progress.reached(ERRORS * (k + 1) as f64 / all);
    }
    let refit = Refit {
        problems: &problems,
        count: flights.len(),
        tolerances: settings.tolerances,
        progress,
    };
    let found = selected(&refit, alone, settings.max_effects)?;
    begin(progress, "the remaining residual")?;
    let (joint_fit, bare) = (found.joint_fit, found.bare);
    let report = report(
        &joint_fit,
        found.plain.clone(),
        found.unadjusted,
        found.names.clone(),
        found.nearest,
        progress,
    )?;
    if let Some(bare) = bare.filter(|_| !found.names.is_empty()) {
        let (flights, named) = ((joint_fit, bare), (found.names, found.plain));
        return beside_names(&refit, flights, named, report, settings.max_effects);
    }
    match report.verdict {
        Outcome::Unexplained => by_description(&refit, joint_fit, report),
        // Loads and inputs that change fast may look like errors of the suit.
        Outcome::Calibrated if !scored(&joint_fit).is_empty() => {
            by_description(&refit, joint_fit, report)
        }
        _ => Ok(report),
    }
}

/// Describes what no effect with a value explains, or names an effect that changes at random. `bare` has the flights
/// without effects.
fn by_description<'a>(refit: &Refit<'a>, bare: JointFit<'a>, report: Report) -> Result<Report> {
    let report = described(&bare, report, refit.progress)?;
    if report.verdict == Outcome::Described {
        Ok(report)
    } else {
        by_strength(refit, bare, report)
    }
}

/// Names an effect that changes at random beside those with a value, or in their place if they are not certain beside it.
/// Otherwise, what they do not explain is described.
///
/// The flights are those with the names and those without any effect. `plain` has the errors of the latter.
fn beside_names<'a>(
    refit: &Refit<'a>,
    (joint_fit, bare): (JointFit<'a>, JointFit<'a>),
    (mut names, plain): (Vec<NamedEffect>, Option<Vec<FittedErrors>>),
    before: Report,
    max_effects: usize,
) -> Result<Report> {
    let is_possible = names.len() < max_effects && before.verdict != Outcome::Thin;
    if is_possible
        && let Some(found) = strongest(refit, joint_fit, 0.0)?
        && found.stands_out
    {
        let bars = error_bars(&found.with, refit.progress);
        if bars.redundant().is_some() {
            return by_strength(refit, bare, before);
        }
        names.push(found.name);
        let unadjusted = before.misfit_unadjusted;
        let named = report(&found.with, plain, unadjusted, names, None, refit.progress)?;
        let is_left = named.remainders.iter().any(|left| left.is_unexplained);
        if !is_left && named.verdict == Outcome::Named {
            return Ok(named);
        }
    }
    match before.verdict {
        Outcome::Unexplained => by_description(refit, bare, before),
        _ => Ok(before),
    }
}

/// Names an effect that changes at random, or lists it as the nearest.
///
/// A random process explains a part of any load, so it must leave nothing for unknown loads to explain, and the flights
/// must be more likely with it alone than with anything else that was tried.
fn by_strength<'a>(refit: &Refit<'a>, bare: JointFit<'a>, before: Report) -> Result<Report> {
    let described = before.nearest_description.as_ref();
    let gain = described.map_or(0.0, |nearest| (nearest.gain - nearest.cost).max(0.0));
    let Some(found) = strongest(refit, bare, gain)? else {
        return Ok(before);
    };
    let plain = found.without.without_wrench(refit.progress)?;
    let unadjusted = before.misfit_unadjusted;
    let names = vec![found.name];
    let mut named = report(&found.with, plain, unadjusted, names, None, refit.progress)?;
    let is_left = named.remainders.iter().any(|left| left.is_unexplained);
    if found.stands_out && !is_left && named.verdict == Outcome::Named {
        return Ok(named);
    }
    let mut before = before;
    if found.is_significant {
        before.nearest.append(&mut named.effects);
        before.nearest.append(&mut named.nearest);
    }
    Ok(before)
}
