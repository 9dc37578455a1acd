//! Competitors nearly as good as the best candidate are refitted as well, and a better one replaces it.

use crate::named_effect::EffectSet;

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{BestHypothesis, Hypothesis, NamedEffect, is_significant};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::score_test::JointFit;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::progress::begin;

/// A candidate with the flights fitted together with it.
struct RefittedRunnerUp<'a> {
    hypothesis: Hypothesis,
    joint_fit: JointFit<'a>,
}

/// A candidate that was not certain, since the last name.
pub(crate) struct SetAside {
    pub(crate) first_order: Hypothesis,
    pub(crate) refitted: Hypothesis,
}

/// Candidates that seem good enough to be compared with `one`.
fn challenging(hypotheses: &[Hypothesis], one: &Hypothesis) -> Vec<Hypothesis> {
    let best = one.score();
    let least = f64::min(
        DECISION.runner_up_share * best,
        best - DECISION.runner_up_gain,
    )
    .max(0.0);
    let others = hypotheses
        .iter()
        .filter(|other| other.effect != one.effect && other.matters() && other.score() > least);
    others.take(DECISION.runner_ups).cloned().collect()
}

/// Returns the candidate that was found, or a close competitor that proves better once everything is refitted with
/// it, together with the flights fitted with it if that succeeds.
///
/// Those in `set_aside` compete again as they were to first order: what is found with another effect may lead them out of a
/// poor minimum. What the flights without any of them gain is taken from their gains.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn fitted_beside<'a>(
    refit: &Refit<'a>,
    files: &JointFit<'a>,
    joint_fit: &mut JointFit<'a>,
    found: BestHypothesis,
    set_aside: &mut [SetAside],
) -> Result<(NamedEffect, Option<JointFit<'a>>)> {
    let BestHypothesis {
        hypothesis,
        hypotheses,
        around_files,
    } = found;
    let aside = set_aside.iter().map(|one| one.first_order.clone());
    let hypotheses: Vec<Hypothesis> = aside.chain(hypotheses).collect();
    let mut name = NamedEffect {
        hypothesis,
        others: Vec::new(),
    };
    let what = name.hypothesis.effect.description().name;
    begin(refit.progress, &format!("errors beside {what}"))?;
    let from = if around_files { files } else { &*joint_fit };
    let Some(mut next) = refit.with(joint_fit, from, &name.hypothesis)? else {
        return Ok((name, None));
    };
    let mut others = challenging(&hypotheses, &name.hypothesis);
    name.hypothesis = refit.compared(joint_fit, &next, &name.hypothesis)?;
    if !is_significant(&name.hypothesis) {
        refit.refitted_from(&mut next, joint_fit)?;
        let again = refit.compared(joint_fit, &next, &name.hypothesis)?;
        name.hypothesis = joint_fit.checked_without_refit(again, refit.progress);
        if !is_significant(&name.hypothesis) {
            return Ok((name, Some(next)));
        }
    }
    let first = name.hypothesis.effect;
    let alone = joint_fit.likelihoods();
    let (gained, retried) = refit.retried(joint_fit, next)?;
    next = retried;
    if gained > DECISION.refit_allowance() {
        // The choice was made with poorly fitted flights, so look for competitors again.
        let mut fresh = joint_fit.hypotheses(&[first], refit.progress)?;
        fresh.retain(|other| other.matters() && other.is_promising());
        fresh.retain(|other| others.iter().all(|known| known.effect != other.effect));
        fresh.truncate(DECISION.runner_ups);
        others.truncate(DECISION.runner_ups / 2);
        others.append(&mut fresh);
    }
    name.hypothesis = refit.compared(joint_fit, &next, &name.hypothesis)?;
    challenge(refit, joint_fit, &mut next, &mut name, others)?;
    if name.hypothesis.effect != first {
        let before = joint_fit.likelihoods();
        (_, next) = refit.retried(joint_fit, next)?;
        name.less_likely(&joint_fit.gained_since(&before));
        name.hypothesis = refit.compared(joint_fit, &next, &name.hypothesis)?;
    }
    let gained = joint_fit.gained_since(&alone);
    for one in set_aside {
        one.refitted.less_likely(&gained);
    }
    Ok((name, Some(next)))
}

/// Refits the competitors of the candidate that was found. A better one replaces it.
fn challenge<'a>(
    refit: &Refit<'a>,
    joint_fit: &JointFit<'a>,
    next: &mut JointFit<'a>,
    name: &mut NamedEffect,
    mut others: Vec<Hypothesis>,
) -> Result<()> {
    loop {
        let mut tried = challengers(refit, joint_fit, next, &others)?;
        // The best was fitted with slopes of its own, so one that is close without them gets the same chance.
        let score = name.hypothesis.score();
        let is_close = |other: &RefittedRunnerUp<'_>| {
            other.hypothesis.score() > score * (1.0 - DECISION.runner_up_deficit)
        };
        if tried.first().is_some_and(is_close) {
            let best = tried.swap_remove(0);
            let before = best.hypothesis.clone();
            others.retain(|other| other.effect != before.effect);
            if let Some(with) = finished(refit, best)? {
                let best = refit.compared(joint_fit, &with, &before)?;
                if best.replaces(&name.hypothesis) {
                    name.others
                        .push(core::mem::replace(&mut name.hypothesis, best));
                    *next = with;
                    continue;
                }
                name.others.push(best);
            }
        }
        name.others
            .extend(tried.into_iter().map(|other| other.hypothesis));
        return Ok(());
    }
}

/// Log-likelihood of the fitted flights below which a competitor is dropped.
fn hopeless(joint_fit: &JointFit<'_>, next: &JointFit<'_>) -> f64 {
    let best = next.likelihood();
    best - f64::max(
        DECISION.hopeless_deficit,
        DECISION.hopeless_share * (best - joint_fit.likelihood()),
    )
}

/// Competitors after refitting, best first.
fn challengers<'a>(
    refit: &Refit<'a>,
    joint_fit: &JointFit<'a>,
    next: &JointFit<'a>,
    others: &[Hypothesis],
) -> Result<Vec<RefittedRunnerUp<'a>>> {
    let mut tried = Vec::new();
    if others.is_empty() {
        return Ok(tried);
    }
    let alike = refit.alike(joint_fit, next)?;
    for other in others {
        let what = other.effect.description().name;
        begin(refit.progress, &format!("errors beside {what}"))?;
        if let Some(other) = challenged(refit, (joint_fit, &alike), next, other)? {
            tried.push(other);
        }
    }
    tried.sort_by(|a, b| b.hypothesis.score().total_cmp(&a.hypothesis.score()));
    Ok(tried)
}

/// Refits everything together with a competitor, using the slopes of the best candidate's fit.
fn challenged<'a>(
    refit: &Refit<'a>,
    (joint_fit, alike): (&JointFit<'a>, &[f64]),
    next: &JointFit<'a>,
    other: &Hypothesis,
) -> Result<Option<RefittedRunnerUp<'a>>> {
    let of = |flights: &[(&FlightProblem<'a>, LinearFit)], effects: &EffectSet| {
        let each = flights.iter().map(|(problem, fitted)| {
            let point = fitted.point_with(effects);
            problem.fit_with_slopes_of(fitted, &point, refit.progress)
        });
        each.collect::<Result<Option<Vec<LinearFit>>>>()
    };
    let settled = |(problem, fitted): (&FlightProblem<'a>, LinearFit)| {
        problem.settled(fitted, refit.progress)
    };
    let Some(first) = of(&next.fitted, &other.effects)? else {
        return Ok(None);
    };
    let round = refit.round(first, other.effects.clone())?;
    let round = refit.with_same_slopes(round)?;
    if round.likelihood() < hopeless(joint_fit, next) {
        return Ok(None);
    }
    let (fitted, effects) = (round.fitted, round.effects);
    let Some(held_out) = of(&next.held_out, &effects)? else {
        return Ok(None);
    };
    let each = refit
        .problems
        .iter()
        .zip(fitted.into_iter().chain(held_out));
    let fitted = each.map(settled).collect::<Result<Vec<_>>>()?;
    let with = refit.joint_fit(fitted, effects);
    Ok(Some(RefittedRunnerUp {
        hypothesis: joint_fit.compared(&with, other, alike),
        joint_fit: with,
    }))
}

/// Recomputes the slopes of a competitor that was fitted with those of another candidate.
fn finished<'a>(
    refit: &Refit<'a>,
    challenger: RefittedRunnerUp<'a>,
) -> Result<Option<JointFit<'a>>> {
    let joint_fit = challenger.joint_fit;
    let fitted = joint_fit.fitted.into_iter().map(|(_, fitted)| fitted);
    let round = refit.round(fitted.collect(), joint_fit.effects)?;
    let (mut fitted, effects) = refit.with_new_slopes(round)?;
    for (problem, fit) in &joint_fit.held_out {
        let point = fit.point_with(&effects);
        let Some(fit) = problem.fit(&point, Some(&fit.errors), 1, refit.progress)? else {
            return Ok(None);
        };
        fitted.push(problem.converged(fit, refit.progress)?);
    }
    Ok(Some(refit.joint_fit(fitted, effects)))
}
