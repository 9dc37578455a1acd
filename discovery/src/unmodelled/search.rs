//! Describes what no effect of the library explains: a search over loads of a small grammar, penalized by the number of
//! alternatives.
//!
//! The residuals of a flight show how much a force or a moment in each tenth of a second would gain ([`projection`](crate::unmodelled::projection)).
//! Products of a direction and a few factors ([`grammar`](crate::unmodelled::grammar)) are ranked by that gain. The best is extended by others
//! that share its factors ([`term`](crate::unmodelled::term)) and fitted in simulated flights ([`fit`](crate::unmodelled::fit)), and the errors are refitted. The gain
//! must exceed three for each fitted parameter (Schwarz) plus the logarithm of the number of alternatives. The search
//! is then repeated on the remaining residual.

use crate::named_effect::{EffectSet, Outcome};
use bodyflight_core::dynamics::applied_load::Kind;
use bodyflight_core::dynamics::applied_load::factor::Factor;
use nalgebra::DMatrix;

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::score_test::JointFit;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::output::description::{Described, DescribedLoad};
use crate::output::report::{ErrorSizes, HeldOut, Report};
use crate::output::residual_rms::gap_from;
use crate::output::residual_wrench::Remainder;
use crate::progress::{Progress, begin, check};
use crate::unmodelled::fit::{Groups, Number, followed, loads, numbers};
use crate::unmodelled::grammar::{factor_in_words, pointing_in_words};
use crate::unmodelled::projection::View;
use crate::unmodelled::term::{Group, best_group, shifted};

/// A flight under given loads, with its errors fitted.
struct Flown<'a> {
    problem: FlightProblem<'a>,
    fitted: LinearFit,
}

/// Refits the errors of a flight under given loads. Returns `None` if the simulation diverges.
fn refitted<'a>(
    problem: &FlightProblem<'a>,
    before: &LinearFit,
    groups: &[Group],
    progress: &dyn Progress,
) -> Result<Option<Flown<'a>>> {
    let Some(loads) = loads(groups) else {
        return Ok(None);
    };
    let problem = problem.under(&loads);
    let point = before.point_with(&EffectSet::new());
    let fitted = problem.fit(&point, Some(&before.errors), 1, progress)?;
    Ok(fitted.map(|fitted| Flown { problem, fitted }))
}

/// Share of what arbitrary forces and moments could explain in a flight that the loads explain.
fn explained(
    before: (&FlightProblem<'_>, &LinearFit),
    after: &Flown<'_>,
    progress: &dyn Progress,
) -> Result<f64> {
    let quiet = before.1.without_wrench(&before.0.prior, progress)?;
    let left = after
        .fitted
        .without_wrench(&after.problem.prior, progress)?;
    let (Some(quiet), Some(left)) = (quiet, left) else {
        return Ok(0.0);
    };
    let gained = left.likelihood - quiet.likelihood;
    let could = after.fitted.errors.likelihood - quiet.likelihood;
    Ok(share(gained, could))
}

/// The share `gained` of what `could` be gained: zero where the loads gain nothing, at most one.
fn share(gained: f64, could: f64) -> f64 {
    if gained > 0.0 {
        gained / could.max(gained)
    } else {
        0.0
    }
}

/// Removes loads that are not significantly different from zero.
fn pruned(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    groups: Groups,
    covariance: &DMatrix<f64>,
) -> Option<Groups> {
    let numbers = numbers(&groups);
    let mut kept = groups.clone();
    for (g, group) in groups.iter().enumerate() {
        let is_sure = |term: usize| {
            let place = numbers.iter().position(|n| *n == Number::Size(g, term));
            let deviation = place.map_or(0.0, |k| covariance[(k, k)].max(0.0).sqrt());
            group.terms[term].1.abs() > DECISION.load_z * deviation
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
    bare: (&FlightProblem<'a>, &LinearFit),
    progress: &dyn Progress,
) -> Result<Option<(Groups, Flown<'a>)>> {
    let mut groups = Groups::new();
    let mut best: Option<Flown<'a>> = None;
    let mut gained = 0.0;
    while groups.len() < DECISION.groups {
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
        if gain < cost.max(DECISION.group_share * gained) {
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
pub(crate) fn described(
    bare: &JointFit<'_>,
    report: Report,
    progress: &dyn Progress,
) -> Result<Report> {
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
    let cost: f64 = groups.iter().map(Group::cost).sum();
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
    let holds = |(_, _, gain, share): &(_, _, f64, f64)| {
        *gain > DECISION.description_held_out_gain && *share > DECISION.description_share_held_out
    };
    if gain < cost + DECISION.refit_allowance()
        || share < DECISION.description_share
        || !others.iter().all(holds)
    {
        return Ok(Report {
            nearest_description: Some(description),
            ..report
        });
    }
    let quiet = flown
        .fitted
        .without_wrench(&flown.problem.prior, progress)?;
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
fn in_words(groups: &[Group], covariance: &DMatrix<f64>) -> Vec<DescribedLoad> {
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

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::share;

    proptest! {
        #[test]
        fn a_share_is_between_nothing_and_all(gained in -1e9..1e9_f64, could in -1e9..1e9_f64) {
            prop_assert!((0.0..=1.0).contains(&share(gained, could)));
        }
    }

    #[test]
    fn loads_that_make_a_flight_less_likely_explain_nothing() {
        // Found in a flight in which no load could explain anything: a share of -1.2e10.
        assert!(share(-12.0, -15.0) < 1e-9);
        assert!((share(3.0, 4.0) - 0.75).abs() < 1e-9);
    }
}
