//! Names effects that change at random, by their strengths, in flights that nothing else explains.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{Hypothesis, NamedEffect, is_significant};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::score_test::JointFit;
use crate::jacobian::effect_parameters::estimated;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::random_effect_fit::{
    TRIED, likelihood_of_loads, scores, standard_errors, strengths,
};
use crate::progress::{Progress, begin, check};

/// Number of alternating fits of the strengths and of everything else.
const ALTERNATIONS: usize = 2;

/// A named effect, and the flights fitted with it.
type StrengthFit<'a> = (Hypothesis, JointFit<'a>);

/// An effect that changes at random, fitted together with everything else.
pub(crate) struct RandomEffect<'a> {
    pub(crate) name: NamedEffect,
    /// The flights without it, refitted.
    pub(crate) without: JointFit<'a>,
    /// The flights with it.
    pub(crate) with: JointFit<'a>,
    pub(crate) is_significant: bool,
    /// Whether the flights are more likely with it than with anything else that was tried.
    pub(crate) stands_out: bool,
}

/// The effect that changes at random and gains most in flights that neither values nor a description explain, beside the
/// effects that are named in them, if any is worth fitting. `description_gain` is the gain of the nearest description
/// beyond its cost.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn strongest<'a>(
    refit: &Refit<'a>,
    mut without: JointFit<'a>,
    description_gain: f64,
) -> Result<Option<RandomEffect<'a>>> {
    begin(refit.progress, "what changes at random")?;
    let mut best: Option<StrengthFit<'a>> = None;
    for effect in scored(&without) {
        let what = effect.0.description().name;
        begin(refit.progress, &format!("errors beside {what}"))?;
        let Some(fit) = beside_strength(refit, &without, effect)? else {
            continue;
        };
        let score = fit.0.score();
        if best.as_ref().is_none_or(|(best, _)| score > best.score()) {
            best = Some(fit);
        }
    }
    let Some((hypothesis, with)) = best else {
        return Ok(None);
    };
    refit.refitted_from(&mut without, &with)?;
    // An effect that changes at random acts on the covariance alone, so what this gains is its own.
    let hypothesis = without.compared(&with, &hypothesis, &[]);
    let is_significant = is_significant(&hypothesis);
    let stands_out =
        is_significant && stands_out(&without, &with, description_gain, refit.progress)?;
    Ok(Some(RandomEffect {
        name: NamedEffect {
            hypothesis,
            others: Vec::new(),
        },
        without,
        with,
        is_significant,
        stands_out,
    }))
}

/// Whether flights are more likely with an effect and no unknown load than with unknown loads that change within
/// tenths of a second, with loads that change more slowly, and, for the first flight, with the nearest description.
fn stands_out(
    before: &JointFit<'_>,
    next: &JointFit<'_>,
    description_gain: f64,
    progress: &dyn Progress,
) -> Result<bool> {
    let (mut gain, mut gain_over_loads) = (0.0, 0.0);
    let flights = before.fitted.iter().chain(&before.held_out);
    let next = next.fitted.iter().chain(&next.held_out);
    for (k, ((_, plain), (problem, fitted))) in flights.zip(next).enumerate() {
        let quiet = fitted.without_wrench(&problem.prior, progress)?;
        // The loads are tried around the fits with and without the effect, so that neither has an advantage.
        let loads = [plain, fitted].map(|at| likelihood_of_loads(problem, at, progress));
        check(progress)?;
        let (Some(quiet), [Some(here), Some(there)]) = (quiet, loads) else {
            return Ok(false);
        };
        let loads = here.max(there);
        let own = quiet.likelihood - plain.errors.likelihood;
        if own < 0.0 || (k == 0 && own < description_gain + DECISION.refit_allowance()) {
            return Ok(false);
        }
        gain += own;
        gain_over_loads += quiet.likelihood - loads;
    }
    Ok(gain > DECISION.refit_allowance() && gain_over_loads > DECISION.refit_allowance())
}

/// Effects that are worth fitting, best first.
pub(crate) fn scored(joint_fit: &JointFit<'_>) -> EffectSet {
    let tried: EffectSet = TRIED.to_vec();
    let of = |flights: &[(&FlightProblem<'_>, LinearFit)]| -> Vec<Vec<f64>> {
        let each = flights.iter();
        each.map(|(problem, fitted)| scores(problem, fitted, &tried))
            .collect()
    };
    let (here, there) = (of(&joint_fit.fitted), of(&joint_fit.held_out));
    let least = |scores: &[Vec<f64>], k: usize| {
        scores
            .iter()
            .map(|scores| scores[k])
            .fold(f64::INFINITY, f64::min)
    };
    let mut scored: Vec<(f64, _)> = tried
        .iter()
        .enumerate()
        .filter(|(k, _)| {
            least(&here, *k) > DECISION.score_z && least(&there, *k) > DECISION.score_z_held_out
        })
        .map(|(k, effect)| (least(&here, k), *effect))
        .collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let best = scored.first().map_or(0.0, |(score, _)| *score);
    scored.retain(|(score, _)| *score > DECISION.score_share * best);
    scored.into_iter().map(|(_, effect)| effect).collect()
}

/// Refits everything together with an effect, including its strengths.
fn beside_strength<'a>(
    refit: &Refit<'a>,
    joint_fit: &JointFit<'a>,
    (effect, tried): (Effect, [f64; PARAMETER_COUNT]),
) -> Result<Option<StrengthFit<'a>>> {
    let mut effects = joint_fit.effects.clone();
    effects.push((effect, tried));
    let mut fits = Vec::new();
    for (problem, alone) in &joint_fit.fitted {
        let (point, errors) = (alone.start_with(&effects), alone.plausible_errors());
        let Some(fit) = problem.fit(&point, errors, 1, refit.progress)? else {
            return Ok(None);
        };
        fits.push((*problem, fit));
    }
    for _ in 0..ALTERNATIONS {
        let flights: Vec<_> = fits.iter().map(|(problem, fit)| (*problem, fit)).collect();
        let Some(own) = effects.iter_mut().find(|(known, _)| *known == effect) else {
            return Ok(None);
        };
        let found = strengths(&flights, effect, &own.1, refit.progress);
        check(refit.progress)?;
        let Some(values) = found else {
            return Ok(None);
        };
        own.1 = values;
        let mut next = Vec::new();
        for (problem, fit) in &fits {
            let point = fit.point_with(&effects);
            let Some(fit) = problem.fit(&point, Some(&fit.errors), 1, refit.progress)? else {
                return Ok(None);
            };
            next.push(fit);
        }
        if !joint_fit.effects.is_empty() {
            // Those with a value were fitted to flights of which the random one was a part.
            let round = refit.with_same_slopes(refit.round(next, effects)?)?;
            (next, effects) = (round.fitted, round.effects);
        }
        for ((_, fit), next) in fits.iter_mut().zip(next) {
            *fit = next;
        }
    }
    let mut all = Vec::new();
    for (problem, fit) in fits {
        all.push(problem.converged(fit, refit.progress)?);
    }
    let Some(next) = refit.with_held_out(all, joint_fit, effects.clone())? else {
        return Ok(None);
    };
    let values = next.effects.last().map_or(tried, |(_, values)| *values);
    let Some(errors) = standard_errors(&next.flights(), effect, &values) else {
        return Ok(None);
    };
    let variances = estimated(effect).iter().zip(errors);
    let variances: Vec<f64> = variances.map(|(_, error)| error * error).collect();
    let hypothesis = Hypothesis {
        effect,
        effects,
        covariance: DMatrix::from_diagonal(&DVector::from_vec(variances)),
        // Standard errors of strengths already say that neighbouring stretches see the same path.
        tempering: 1.0,
        gain: 0.0,
        gains_held_out: Vec::new(),
        gain_without_refit: None,
    };
    Ok(Some((joint_fit.compared(&next, &hypothesis, &[]), next)))
}
