//! Describes what no effect of the library explains: a search over loads of a small grammar, penalized by the number of
//! alternatives.
//!
//! The residuals of a flight show how much a force or a moment in each tenth of a second would gain ([`view`]).
//! Products of a direction and a few factors ([`dictionary`]) are ranked by that gain. The best is extended by others
//! that share its factors ([`group`]) and fitted in simulated flights ([`fit`]), and the errors are refitted. The gain
//! must exceed three for each fitted parameter (Schwarz) plus the logarithm of the number of alternatives. The search
//! is then repeated on the remaining residual.

pub mod dictionary;
pub mod fit;
pub mod group;
pub mod told;
pub mod view;

use bodyflight_core::dynamics::applied_load::Kind;
use bodyflight_core::dynamics::applied_load::factor::Factor;
use nalgebra::DMatrix;

use super::contest::Scene;
use super::effect_set::EffectSet;
use super::error::Result;
use super::fitted::Fitted;
use super::gap::gap_from;
use super::problem::Problem;
use super::progress::{Progress, begin, check};
use super::remainder::{Remainder, without_push};
use super::report::{ErrorSizes, HeldOut, Outcome, Report};
use dictionary::{factor_in_words, pointing_in_words};
use fit::{Groups, Number, followed, loads, numbers};
use group::{best_group, shifted};
use told::{Described, DescribedLoad};
use view::View;

/// Maximum number of groups of loads.
const GROUPS: usize = 4;

/// Share of the previous groups' gain that a further group must gain.
const MATERIAL: f64 = 0.03;

/// Standard errors by which a load must differ from zero.
const SURE: f64 = 4.0;

/// Gain that a description needs beyond its cost, and gain needed in each held-out flight.
const BEYOND_COST: f64 = 12.0;
const VOTE: f64 = 4.0;

/// Share of what arbitrary forces and moments could explain that a description must explain, in the fitted and in the
/// held-out flights.
const EXPLAINS: f64 = 0.6;
const EXPLAINS_HELD_OUT: f64 = 0.7;

/// A flight under given loads, with its errors fitted.
struct Flown<'a> {
    problem: Problem<'a>,
    fitted: Fitted,
}

/// Refits the errors of a flight under given loads. Returns `None` if the simulation diverges.
fn refitted<'a>(
    problem: &Problem<'a>,
    before: &Fitted,
    groups: &[group::Group],
    progress: &dyn Progress,
) -> Result<Option<Flown<'a>>> {
    let Some(loads) = loads(groups) else {
        return Ok(None);
    };
    let problem = problem.under(&loads);
    let belief = before.belief_with(&EffectSet::new());
    let fitted = problem.fit(&belief, Some(&before.errors), 1, progress)?;
    Ok(fitted.map(|fitted| Flown { problem, fitted }))
}

/// Share of what arbitrary forces and moments could explain in a flight that the loads explain.
fn explained(
    before: (&Problem<'_>, &Fitted),
    after: &Flown<'_>,
    progress: &dyn Progress,
) -> Result<f64> {
    let quiet = without_push(before.0, before.1, progress)?;
    let left = without_push(&after.problem, &after.fitted, progress)?;
    let (Some(quiet), Some(left)) = (quiet, left) else {
        return Ok(0.0);
    };
    let gained = left.likelihood - quiet.likelihood;
    let could = after.fitted.errors.likelihood - quiet.likelihood;
    Ok(gained / could.max(gained).max(1e-9))
}

/// Removes loads that are not significantly different from zero.
fn pruned(
    problem: &Problem<'_>,
    fitted: &Fitted,
    groups: Groups,
    covariance: &DMatrix<f64>,
) -> Option<Groups> {
    let numbers = numbers(&groups);
    let mut kept = groups.clone();
    for (g, group) in groups.iter().enumerate() {
        let is_sure = |term: usize| {
            let place = numbers.iter().position(|n| *n == Number::Size(g, term));
            let deviation = place.map_or(0.0, |k| covariance[(k, k)].max(0.0).sqrt());
            group.terms[term].1.abs() > SURE * deviation
        };
        let terms = (0..group.terms.len()).filter(|term| is_sure(*term));
        kept[g].terms = terms.map(|term| group.terms[term]).collect();
    }
    kept.retain(|group| !group.terms.is_empty());
    if kept.is_empty() {
        return None;
    }
    if kept == groups {
        return Some(kept);
    }
    followed(problem, fitted, &kept).map(|(groups, _)| groups)
}

/// Describes the residual of the first flight. Returns `None` if no load gains more than it costs.
fn sought<'a>(
    bare: (&Problem<'a>, &Fitted),
    progress: &dyn Progress,
) -> Result<Option<(Groups, Flown<'a>)>> {
    let mut groups = Groups::new();
    let mut best: Option<Flown<'a>> = None;
    let mut gained = 0.0;
    while groups.len() < GROUPS {
        begin(progress, "loads that describe the residual")?;
        let (problem, fitted) = best
            .as_ref()
            .map_or(bare, |flown| (&flown.problem, &flown.fitted));
        let Some(view) = View::new(problem, fitted) else {
            break;
        };
        let Some(found) = best_group(&view, problem) else {
            break;
        };
        check(progress)?;
        let cost = found.cost();
        let mut next = groups.clone();
        next.push(found);
        let Some((next, covariance)) = followed(problem, fitted, &next) else {
            break;
        };
        let Some(next) = pruned(problem, fitted, next, &covariance) else {
            break;
        };
        let Some(flown) = refitted(problem, fitted, &next, progress)? else {
            break;
        };
        let gain = flown.fitted.errors.likelihood - fitted.errors.likelihood;
        if gain < cost.max(MATERIAL * gained) {
            break;
        }
        gained += gain;
        groups = next;
        best = Some(flown);
    }
    Ok(best.map(|flown| (groups, flown)))
}

/// Describes what the library does not explain. Returns the report unchanged if no load does.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub fn described(bare: &Scene<'_>, report: Report, progress: &dyn Progress) -> Result<Report> {
    let Some((problem, fitted)) = bare.fitted.first() else {
        return Ok(report);
    };
    let Some((groups, flown)) = sought((problem, fitted), progress)? else {
        return Ok(report);
    };
    let Some((groups, covariance)) = followed(&flown.problem, &flown.fitted, &groups) else {
        return Ok(report);
    };
    let gain = flown.fitted.errors.likelihood - fitted.errors.likelihood;
    let cost: f64 = groups.iter().map(group::Group::cost).sum();
    let share = explained((problem, fitted), &flown, progress)?;
    begin(progress, "the description in the other flights")?;
    let mut others = Vec::new();
    for (problem, fitted) in bare.fitted.iter().skip(1).chain(&bare.held_out) {
        let Some(view) = View::new(problem, fitted) else {
            return Ok(report);
        };
        let own: Groups = groups.iter().map(|group| shifted(&view, group)).collect();
        let Some(other) = refitted(problem, fitted, &own, progress)? else {
            return Ok(report);
        };
        let gain = other.fitted.errors.likelihood - fitted.errors.likelihood;
        let share = explained((problem, fitted), &other, progress)?;
        others.push((*problem, other, gain, share));
    }
    let description = Described {
        loads: in_words(&groups, &covariance),
        gain,
        cost,
        explained: share,
        explained_held_out: others.iter().map(|(.., share)| *share).collect(),
    };
    let holds = |(_, _, gain, share): &(_, _, f64, f64)| *gain > VOTE && *share > EXPLAINS_HELD_OUT;
    if gain < cost + BEYOND_COST || share < EXPLAINS || !others.iter().all(holds) {
        return Ok(Report {
            nearest_description: Some(description),
            ..report
        });
    }
    let quiet = without_push(&flown.problem, &flown.fitted, progress)?;
    let (gap, residual_map) = gap_from(problem, &flown.problem, &flown.fitted, &EffectSet::new());
    let held_out = others.iter().skip(bare.fitted.len() - 1);
    let held_out = held_out.map(|(plain, other, gain, _)| HeldOut {
        gain: *gain,
        gap: gap_from(plain, &other.problem, &other.fitted, &EffectSet::new()).0,
        remainder: Remainder::new(&other.problem, &other.fitted, None),
    });
    Ok(Report {
        verdict: Outcome::Described,
        fly_next:
            "the same load in another posture and at another speed, to show what it depends on"
                .to_owned(),
        remainders: vec![Remainder::new(
            &flown.problem,
            &flown.fitted,
            quiet.as_ref(),
        )],
        errors: vec![ErrorSizes::new(&flown.problem, &flown.fitted)],
        held_out: held_out.collect(),
        gap,
        residual_map,
        description: Some(description),
        ..report
    })
}

/// Loads in words, with standard errors.
fn in_words(groups: &[group::Group], covariance: &DMatrix<f64>) -> Vec<DescribedLoad> {
    let numbers = numbers(groups);
    let error = |number: Number| {
        let place = numbers.iter().position(|other| *other == number);
        place.map(|k| covariance[(k, k)].max(0.0).sqrt())
    };
    let mut all = Vec::new();
    for (g, group) in groups.iter().enumerate() {
        let factors = group.factors.iter().enumerate();
        let factors: Vec<String> = factors
            .filter_map(|(place, factor)| {
                let factor = factor.as_ref()?;
                let error = matches!(factor, Factor::Sine { .. })
                    .then(|| error(Number::Frequency(g, place)))
                    .flatten();
                Some(format!(", {}", factor_in_words(factor, error)))
            })
            .collect();
        for (term, (load, (pointing, size))) in group.loads().zip(&group.terms).enumerate() {
            let unit = match pointing.0 {
                Kind::Moment => "N m",
                Kind::Force(_) => "N",
            };
            let standard_error = error(Number::Size(g, term)).unwrap_or(0.0);
            all.push(DescribedLoad {
                in_words: format!(
                    "{}, {size:.1} +- {standard_error:.1} {unit}{}",
                    pointing_in_words(*pointing),
                    factors.concat()
                ),
                size: *size,
                standard_error,
                unit,
                load,
            });
        }
    }
    all
}
