//! The outcome of a search: the verdict, and the report with residuals, adjustments and what to fly next.

use bodyflight_core::effect::PARAMETER_COUNT;

use super::adjustment::{adjustments, corrections, joint_calibrations};
use super::candidate::COST;
use super::contest::Scene;
use super::effect_set::EffectSet;
use super::error::{Error, Result};
use super::error_bars::ErrorBars;
use super::error_model::Errors;
use super::gap::gap;
use super::remainder::Remainder;
use super::report::{ErrorSizes, Evidence, HeldOut, Named, Outcome, Report, model_of};
use super::search::{Name, Rejected, Search};

/// Shortest flight in which effects can be distinguished (stretches).
const LEAST_STRETCHES: usize = 20;

/// Share of what arbitrary forces and moments could explain that the named effects must explain.
const EXPLAINS: f64 = 0.6;

/// Misfit per observation above which the fit has failed, so that names found with it mean nothing.
const FAILED: f64 = 1.02;

/// Misfit per observation below which the model as given by the files agrees with the data.
const AGREES: f64 = 1.15;

/// Factor on reported standard errors, for what the linear problem leaves out, above all the uncertainty of the estimated
/// error sizes. Without it, 86 to 88 % of the true parameters of laboratory flights were within their 95 % intervals.
/// Whether an effect acts is decided without it.
const PLUG_IN: f64 = 1.25;

impl<'a> Search<'a> {
    /// Compiles the report.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(super) fn report(
        &self,
        scene: &Scene<'a>,
        plain: Option<Vec<Errors>>,
        unadjusted: f64,
        names: Vec<Name>,
        nearest: Option<Rejected>,
    ) -> Result<Report> {
        let quiet = self.quiet(scene)?;
        let remainders: Vec<Remainder> = scene
            .fitted
            .iter()
            .enumerate()
            .map(|(k, (problem, fitted))| {
                let quiet = quiet.as_ref().and_then(|quiet| quiet.get(k));
                Remainder::new(problem, fitted, quiet)
            })
            .collect();
        let likelihood = |errors: &[Errors]| errors.iter().map(|e| e.likelihood).sum::<f64>();
        let with_push: f64 = scene.fitted.iter().map(|(_, f)| f.errors.likelihood).sum();
        let explained = match (&plain, &quiet) {
            (Some(plain), Some(quiet)) => {
                let gained = likelihood(quiet) - likelihood(plain);
                gained / (with_push - likelihood(plain)).max(gained).max(1e-9)
            }
            _ => 0.0,
        };
        let outcome = outcome(scene, unadjusted, &names, explained, &remainders);
        let errors = self.error_bars(scene).errors;
        let named = |name: &Name| told(name, &scene.effects, &errors, explained);
        let told_names: Vec<Named> = names.iter().map(named).collect();
        let effects = if outcome == Outcome::Named {
            scene.effects.clone()
        } else {
            EffectSet::new()
        };
        let (named, mut near) = outcome.split(told_names);
        let is_near = |near: &Rejected| match outcome {
            Outcome::Calibrated => near.is_alternative,
            _ => near.name.candidate.total() > COST,
        };
        near.extend(nearest.filter(is_near).map(|near| {
            let effects = &near.name.candidate.effects;
            told(&near.name, effects, &near.errors, explained)
        }));
        let mut gaps = scene
            .fitted
            .iter()
            .map(|(problem, fitted)| gap(problem, fitted, &scene.effects));
        let (gap_here, residual_map) = gaps.next().ok_or(Error::Cancelled)?;
        let fly_next = explain(outcome, &named, &remainders);
        Ok(Report {
            verdict: outcome,
            effects: named,
            nearest: near,
            explained,
            misfit_unadjusted: unadjusted,
            errors: scene
                .fitted
                .iter()
                .map(|(problem, fitted)| ErrorSizes::new(problem, fitted))
                .collect(),
            adjustments: adjustments(&scene.fitted),
            joints: scene
                .fitted
                .iter()
                .flat_map(|(_, fitted)| joint_calibrations(fitted))
                .collect(),
            gap: gap_here,
            held_out: held_out(scene, &names),
            residual_map,
            remainders,
            description: None,
            nearest_description: None,
            fly_next,
            model: model_of(&effects),
            corrections: scene
                .fitted
                .first()
                .map_or_else(Vec::new, |(_, f)| model_of(&corrections(f))),
        })
    }

    /// Error bars of the named effects.
    pub(super) fn error_bars(&self, scene: &Scene<'a>) -> ErrorBars {
        let Some((last, _)) = scene.effects.last() else {
            return ErrorBars::default();
        };
        let Some(found) = scene.followed(&scene.effects, *last, self.progress) else {
            return ErrorBars::default();
        };
        let mut bars = scene.error_bars(&found, self.progress);
        for ((effect, errors), (_, values)) in bars.errors.iter_mut().zip(&scene.effects) {
            if effect.is_random() {
                *errors = self.errors_of_strength(scene, *effect, values);
            }
        }
        bars
    }
}

fn outcome(
    scene: &Scene<'_>,
    unadjusted: f64,
    names: &[Name],
    explained: f64,
    remainders: &[Remainder],
) -> Outcome {
    let thin = scene
        .fitted
        .iter()
        .all(|(problem, _)| problem.stretches.len() < LEAST_STRETCHES || problem.track.is_still());
    let unexplained = remainders.iter().any(|left| left.is_unexplained);
    // Joints that wander beyond the suit's limit, or a misfit above one, mean that the fit ended far from the truth.
    let failed = remainders.iter().any(|left| left.is_beyond_suit)
        || scene
            .fitted
            .iter()
            .any(|(_, fitted)| fitted.errors.misfit() > FAILED);
    if thin {
        Outcome::Thin
    } else if !names.is_empty() && !failed && (!unexplained || explained >= EXPLAINS) {
        Outcome::Named
    } else if unexplained || failed {
        Outcome::Unexplained
    } else if unadjusted < AGREES {
        Outcome::None
    } else {
        Outcome::Calibrated
    }
}

/// A named effect with its fitted values and their standard errors.
fn told(name: &Name, effects: &EffectSet, errors: &EffectSet, explained: f64) -> Named {
    let of = |set: &EffectSet| {
        let mut own = set.iter();
        own.find(|(effect, _)| *effect == name.candidate.effect)
            .map(|(_, values)| *values)
    };
    let values = of(effects).unwrap_or_else(|| name.candidate.values());
    let errors = of(errors).unwrap_or([0.0; PARAMETER_COUNT]);
    let evidence = Evidence {
        deviations: name.candidate.deviations(),
        chance: Some(name.chance),
        stability: None,
        explains: explained,
    };
    Named::new(name.candidate.effect, evidence, name.rivals.clone())
        .with_parameters(&values, &errors.map(|error| PLUG_IN * error))
}

/// Gain of the named effects in each held-out flight, and what remains there.
fn held_out(scene: &Scene<'_>, names: &[Name]) -> Vec<HeldOut> {
    let flights = scene.held_out.iter().enumerate();
    flights
        .map(|(k, (problem, fitted))| {
            let gains = names
                .iter()
                .filter_map(|name| name.candidate.gains_held_out.get(k));
            HeldOut {
                gain: gains.sum(),
                gap: gap(problem, fitted, &scene.effects).0,
                remainder: Remainder::new(problem, fitted, None),
            }
        })
        .collect()
}

/// What to fly next.
fn explain(outcome: Outcome, named: &[Named], remainders: &[Remainder]) -> String {
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
        Outcome::Thin => "at least 20 s with changes of posture, attitude and speed".to_owned(),
    }
}
