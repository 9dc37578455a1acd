//! The outcome of a search: the verdict, and the report with residuals, adjustments and what to fly next.

use crate::named_effect::{EffectEvidence, EffectSet, Named, Outcome, model_of};
use bodyflight_core::effect::PARAMETER_COUNT;

use crate::error::{Error, Result};
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{Hypothesis, NamedEffect, Rejected};
use crate::hypotheses::robust_covariance::error_bars;
use crate::hypotheses::score_test::JointFit;
use crate::jacobian::effect_parameters::estimated;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::variance_components::FittedErrors;
use crate::output::adjusted_parameters::{adjustments, corrections, joint_calibrations};
use crate::output::detectable::detectable;
use crate::output::report::{ErrorSizes, HeldOut, Report};
use crate::output::residual_rms::gap;
use crate::output::residual_wrench::Remainder;
use crate::progress::Progress;
use crate::shooting::smoothed_start::is_short;

/// Compiles the report.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn report(
    joint_fit: &JointFit<'_>,
    plain: Option<Vec<FittedErrors>>,
    unadjusted: f64,
    names: Vec<NamedEffect>,
    nearest: Option<Rejected>,
    progress: &dyn Progress,
) -> Result<Report> {
    let quiet = joint_fit.without_wrench(progress)?;
    let remainders: Vec<Remainder> = joint_fit
        .fitted
        .iter()
        .enumerate()
        .map(|(k, (problem, fitted))| {
            let quiet = quiet.as_ref().and_then(|quiet| quiet.get(k));
            Remainder::new(problem, fitted, quiet)
        })
        .collect();
    let explained = explained(joint_fit, plain.as_deref(), quiet.as_deref());
    let outcome = outcome(joint_fit, unadjusted, &names, explained, &remainders);
    let errors = error_bars(joint_fit, progress).errors;
    let named = |name: &NamedEffect| reported_effect(name, &joint_fit.effects, &errors, explained);
    let told_names: Vec<Named> = names.iter().map(named).collect();
    let effects = if outcome == Outcome::Named {
        joint_fit.effects.clone()
    } else {
        EffectSet::new()
    };
    let (named, mut near) = outcome.split(told_names);
    let is_possible =
        |one: &Hypothesis| one.false_discovery_rate() < 1.0 - DECISION.false_discovery_rate;
    let is_near = |near: &Rejected| {
        is_possible(&near.name.hypothesis)
            && (outcome != Outcome::Calibrated || near.is_alternative)
    };
    near.extend(nearest.filter(is_near).map(|near| {
        let effects = &near.name.hypothesis.effects;
        reported_effect(&near.name, effects, &near.errors, explained)
    }));
    let mut gaps = joint_fit
        .fitted
        .iter()
        .map(|(problem, fitted)| gap(problem, fitted, &joint_fit.effects));
    let (gap_here, residual_map) = gaps.next().ok_or(Error::Cancelled)?;
    let fly_next = explain(outcome, &named, &remainders, joint_fit.moving_s());
    let (trusted, detectable) = if has_failed(joint_fit, &remainders) {
        (&[][..], Vec::new())
    } else {
        (&joint_fit.fitted[..], detectable(joint_fit, progress)?)
    };
    Ok(Report {
        verdict: outcome,
        effects: named,
        nearest: near,
        explained,
        misfit_unadjusted: unadjusted,
        errors: joint_fit
            .fitted
            .iter()
            .map(|(problem, fitted)| ErrorSizes::new(problem, fitted))
            .collect(),
        adjustments: adjustments(trusted),
        joints: trusted
            .iter()
            .flat_map(|(_, fitted)| joint_calibrations(fitted))
            .collect(),
        gap: gap_here,
        held_out: held_out(joint_fit, &names),
        residual_map,
        remainders,
        description: None,
        nearest_description: None,
        detectable,
        fly_next,
        changes: Vec::new(),
        warnings: Vec::new(),
        model: model_of(&effects),
        corrections: trusted
            .first()
            .map_or_else(Vec::new, |(_, f)| model_of(&corrections(f))),
    })
}

/// Share of the residual wrench's gain in likelihood that the named effects explain.
fn explained(
    joint_fit: &JointFit<'_>,
    plain: Option<&[FittedErrors]>,
    quiet: Option<&[FittedErrors]>,
) -> f64 {
    let likelihood = |errors: &[FittedErrors]| errors.iter().map(|e| e.likelihood).sum::<f64>();
    let fitted = joint_fit.fitted.iter();
    let with_wrench: f64 = fitted.map(|(_, f)| f.errors.likelihood).sum();
    match (plain, quiet) {
        (Some(plain), Some(quiet)) => {
            let gained = likelihood(quiet) - likelihood(plain);
            gained / (with_wrench - likelihood(plain)).max(gained).max(1e-9)
        }
        _ => 0.0,
    }
}

/// Whether the fit ended far from the truth: joints would have to wander beyond the suit's limit, or the misfit is above
/// one. Its numbers then mean nothing.
fn has_failed(joint_fit: &JointFit<'_>, remainders: &[Remainder]) -> bool {
    let mut flights = joint_fit.fitted.iter();
    let most = |problem: &FlightProblem<'_>, observations: usize| {
        let by_chance = 1.0 + DECISION.failed_z * (2.0 / observations.max(1) as f64).sqrt();
        if is_short(problem.track) {
            by_chance.max(DECISION.failed_misfit)
        } else {
            DECISION.failed_misfit
        }
    };
    remainders.iter().any(|left| left.is_beyond_suit)
        || flights.any(|(problem, fitted)| {
            fitted.errors.misfit() > most(problem, fitted.errors.observations)
        })
}

fn outcome(
    joint_fit: &JointFit<'_>,
    unadjusted: f64,
    names: &[NamedEffect],
    explained: f64,
    remainders: &[Remainder],
) -> Outcome {
    let unexplained = remainders.iter().any(|left| left.is_unexplained);
    let failed = has_failed(joint_fit, remainders);
    let is_explained = !unexplained || explained >= DECISION.explained_share;
    // A jump always leaves something, and its fit ends near the limits of a suit: only the odds of a name count.
    let is_thin = joint_fit.is_thin();
    if !names.is_empty() && (is_thin || (!failed && is_explained)) {
        Outcome::Named
    } else if is_thin {
        Outcome::Thin
    } else if unexplained || failed {
        Outcome::Unexplained
    } else if unadjusted < DECISION.agreeing_misfit {
        Outcome::None
    } else {
        Outcome::Calibrated
    }
}

/// A named effect with its fitted values and their standard errors.
fn reported_effect(
    name: &NamedEffect,
    effects: &EffectSet,
    errors: &EffectSet,
    explained: f64,
) -> Named {
    let of = |set: &EffectSet| {
        let mut own = set.iter();
        own.find(|(effect, _)| *effect == name.hypothesis.effect)
            .map(|(_, values)| *values)
    };
    let values = of(effects).unwrap_or_else(|| name.hypothesis.values());
    let errors = of(errors).unwrap_or([0.0; PARAMETER_COUNT]);
    let evidence = EffectEvidence {
        log_odds: name.hypothesis.log_odds(),
        false_discovery_rate: name.hypothesis.false_discovery_rate(),
        explains: explained,
    };
    let effect = name.hypothesis.effect;
    let errors = errors.map(|error| DECISION.reported_error * error);
    Named::new(effect, evidence, name.rivals()).with_parameters(estimated(effect), &values, &errors)
}

/// Gain of the named effects in each held-out flight, and what remains there.
fn held_out(joint_fit: &JointFit<'_>, names: &[NamedEffect]) -> Vec<HeldOut> {
    let flights = joint_fit.held_out.iter().enumerate();
    flights
        .map(|(k, (problem, fitted))| {
            let gains = names
                .iter()
                .filter_map(|name| name.hypothesis.gains_held_out.get(k));
            HeldOut {
                gain: gains.sum(),
                gap: gap(problem, fitted, &joint_fit.effects).0,
                remainder: Remainder::new(problem, fitted, None),
            }
        })
        .collect()
}

/// What to fly next.
fn explain(outcome: Outcome, named: &[Named], remainders: &[Remainder], moving_s: f64) -> String {
    match outcome {
        Outcome::Named => {
            let rivals = named.iter().find(|named| !named.rivals.is_empty());
            rivals.map_or_else(
                || "no further flight is needed to separate these effects from others".to_owned(),
                |named| {
                    format!(
                        "to tell {} from its rivals, fly {}",
                        named.name, named.separated_by
                    )
                },
            )
        }
        Outcome::None => "nothing; model and data agree".to_owned(),
        Outcome::Calibrated => {
            "the same postures at another speed, belly, back and head-down: mass, area and drag \
            then do different things"
                .to_owned()
        }
        Outcome::Unexplained => {
            let words = remainders.iter().find(|left| left.is_unexplained);
            words.map_or_else(String::new, |left| {
                format!(
                    "a similar flight with more variety; look for {}",
                    left.in_words
                )
            })
        }
        Outcome::Described => "the same load in another posture and at another speed".to_owned(),
        Outcome::Thin => format!(
            "more with changes of posture, attitude and speed, in one flight or in several of the same person: the body \
            moves for {moving_s:.1} s in all, and effects can be told apart from {:.0} s on",
            DECISION.informative_s
        ),
    }
}
