//! Forward selection: errors are estimated first, then an effect is named if the flights, including those held out, are
//! much more likely with it than without it.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, Kind};
use bodyflight_falls::statistics::quantile_of_sorted;

use crate::error::{Error, Result};
use crate::hypotheses::backward_elimination::without_redundant;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{
    BestHypothesis, Hypothesis, NamedEffect, Rejected, by_chance, differs_from_neutral,
    is_significant,
};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::robust_covariance::error_bars;
use crate::hypotheses::runner_up::fitted_beside;
use crate::hypotheses::score_test::JointFit;
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::{LinearFit, unadjusted};
use crate::likelihood::variance_components::FittedErrors;
use crate::progress::{Progress, begin};

/// Share of the progress taken by the errors, and share of the remaining progress left after each effect.
pub(crate) const ERRORS: f64 = 0.4;
const ANOTHER: f64 = 0.3;

/// A flight fitted as if the model lacked nothing.
pub(crate) struct FitWithoutEffects {
    /// Linearized around the files, so that fitted constants cannot hide a missing effect.
    around_files: LinearFit,
    /// Linearized around the flight's own constants.
    settled: LinearFit,
}

impl FitWithoutEffects {
    pub(crate) fn new(problem: &mut FlightProblem<'_>, progress: &dyn Progress) -> Result<Self> {
        let too_short = Error::TooShort {
            least_s: DECISION.shortest_s,
            found_s: problem.track.duration(),
        };
        let files = LinearizationPoint::files();
        problem.without_stretches_beyond_numbers(&files);
        let first = problem.first(progress)?.ok_or(too_short)?;
        problem.weigh(&first);
        let around_files = problem
            .fit(
                &first.point_with_stretches(),
                Some(&first.errors),
                1,
                progress,
            )?
            .ok_or(too_short)?;
        let point = around_files.point_with(&EffectSet::new());
        // If the simulation diverges with the fitted constants, those of the files are kept.
        let settled = match problem.fit(&point, Some(&around_files.errors), 1, progress)? {
            Some(settled) => settled,
            None => problem
                .fit(&files, Some(&around_files.errors), 1, progress)?
                .ok_or(too_short)?,
        };
        Ok(Self {
            around_files,
            settled: problem.converged(settled, progress)?,
        })
    }
}

/// How far to search.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// Maximum number of effects to name.
    pub(crate) max_effects: usize,
    /// Seed of the random draws.
    pub(crate) seed: u64,
}

/// What the search has found.
pub(crate) struct Selection<'a> {
    /// The flights fitted with the named effects.
    pub(crate) joint_fit: JointFit<'a>,
    /// The flights without effects, if any effect was named.
    pub(crate) bare: Option<JointFit<'a>>,
    /// Errors without effects and without unknown forces and moments, if any effect was named.
    pub(crate) plain: Option<Vec<FittedErrors>>,
    /// Misfit of the model as given by the files.
    pub(crate) unadjusted: f64,
    pub(crate) names: Vec<NamedEffect>,
    pub(crate) nearest: Option<Rejected>,
}

/// Reports progress after `tried` effects and a share of the next one.
fn reached(progress: &dyn Progress, tried: usize, share: f64) {
    let left =
        |tried: usize| (1.0 - ERRORS) * ANOTHER.powi(i32::try_from(tried).unwrap_or(i32::MAX));
    let (from, to) = (left(tried), left(tried + 1));
    progress.reached(1.0 - from + (from - to) * share);
}

/// An effect that is not worth a fit of its own.
fn unpromising(name: NamedEffect) -> Rejected {
    Rejected {
        errors: name.hypothesis.standard_errors(&[]),
        name,
        is_alternative: false,
    }
}

/// Whether a candidate is worth refitting everything with it. The threshold is lower than for a name, because errors
/// fitted without the effect may have absorbed part of it.
fn is_promising(hypothesis: &Hypothesis, chance: &[f64]) -> bool {
    let least = quantile_of_sorted(chance, DECISION.null_quantile);
    let is_confirmed =
        hypothesis.z_score_together() > DECISION.least_z.max(least + DECISION.z_beyond_null);
    hypothesis.penalized_gain() > 0.0 && (hypothesis.z_score() > least || is_confirmed)
}

/// The best candidate that matters. Among equals, the first in the library.
fn best(hypotheses: &[Hypothesis], chance: &[f64]) -> Option<NamedEffect> {
    let first = hypotheses.iter().find(|hypothesis| hypothesis.matters())?;
    let equals = hypotheses.iter().filter(|other| {
        other.matters()
            && other.penalized_gain() > first.penalized_gain() - DECISION.equal_rank_gain
    });
    let best = equals.min_by_key(|hypothesis| hypothesis.effect)?;
    Some(NamedEffect {
        rivals: Vec::new(),
        chance: by_chance(best.z_score_together(), chance),
        hypothesis: best.clone(),
    })
}

/// The best candidate in the first of several scenes in which it looks promising.
fn sought(
    progress: &dyn Progress,
    joint_fits: &[&JointFit<'_>],
    out_of_question: &[Effect],
    seed: u64,
) -> Result<Option<BestHypothesis>> {
    let mut found = None;
    for (place, from) in joint_fits.iter().enumerate() {
        let hypotheses = from.hypotheses(out_of_question, progress)?;
        let chance = from.null_distribution(seed);
        let Some(name) = best(&hypotheses, &chance) else {
            continue;
        };
        let is_promising = is_promising(&name.hypothesis, &chance);
        if is_promising || found.is_none() {
            found = Some(BestHypothesis {
                name,
                hypotheses,
                chance,
                around_files: joint_fits.len() > 1 && place == 0,
                is_promising,
            });
        }
        if is_promising {
            break;
        }
    }
    Ok(found)
}

/// Short flights do not tell what acts on the body, but any motion shows errors of sensors.
fn is_nameable(joint_fit: &JointFit<'_>, effect: Effect) -> bool {
    !joint_fit.is_thin() || effect.description().kind == Kind::Measurement
}

/// A candidate or a better competitor, the flights fitted with it if that succeeds, and whether it gains enough.
fn refitted<'a>(
    refit: &Refit<'a>,
    files: &JointFit<'a>,
    joint_fit: &mut JointFit<'a>,
    found: BestHypothesis,
) -> Result<(NamedEffect, Option<JointFit<'a>>, bool)> {
    let chance = found.chance.clone();
    let (mut name, next) = fitted_beside(refit, files, joint_fit, found)?;
    name.chance = by_chance(name.hypothesis.z_score_together(), &chance);
    let is_significant = is_significant(&name.hypothesis, &chance);
    Ok((name, next, is_significant))
}

/// Names effects one after the other, while one is significant.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn selected<'a>(
    refit: &Refit<'a>,
    alone: Vec<FitWithoutEffects>,
    limits: Limits,
) -> Result<Selection<'a>> {
    let none = EffectSet::new();
    let each = alone.into_iter();
    let each = each.map(|alone| (alone.around_files, alone.settled));
    let (files, settled): (Vec<LinearFit>, Vec<LinearFit>) = each.unzip();
    let unadjusted = unadjusted(files.get(..refit.count).unwrap_or(&files));
    let files = refit.joint_fit(files, none.clone());
    let mut joint_fit = refit.joint_fit(settled, none);
    let mut plain: Option<Vec<FittedErrors>> = None;
    let mut names: Vec<NamedEffect> = Vec::new();
    let mut bare: Option<JointFit<'a>> = None;
    let mut nearest: Option<Rejected> = None;
    let mut out_of_question: Vec<Effect> = Vec::new();
    // Candidates rejected since the last name.
    let mut rejected: Vec<Hypothesis> = Vec::new();
    while names.len() < limits.max_effects && out_of_question.len() < DECISION.rejections {
        begin(refit.progress, "comparing the effects of the library")?;
        let tried = names.len() + out_of_question.len();
        // Fitted constants may have absorbed most of a missing effect, so the first effect is sought around the
        // files. The flights' own constants are tried next, because slopes may differ far from the files.
        let joint_fits = &[&files, &joint_fit][names.len().min(1)..];
        let found = sought(refit.progress, joint_fits, &out_of_question, limits.seed)?;
        reached(refit.progress, tried, 0.3);
        let Some(found) = found else {
            break;
        };
        if !found.is_promising {
            nearest.get_or_insert_with(|| unpromising(found.name));
            break;
        }
        let (mut name, next, is_significant) = refitted(refit, &files, &mut joint_fit, found)?;
        reached(refit.progress, tried, 1.0);
        let is_nameable = is_nameable(&joint_fit, name.hypothesis.effect);
        let is_told = is_significant || nearest.is_none();
        let needed = next.as_ref().filter(|_| is_told);
        let bars = needed.map(|next| error_bars(next, refit.progress));
        if let (Some(next), Some(bars)) = (next, &bars)
            && is_significant
            && is_nameable
            && differs_from_neutral(&bars.pooled, names.len())
        {
            name.contest(&core::mem::take(&mut rejected));
            if plain.is_none() {
                plain = joint_fit.without_wrench(refit.progress)?;
            }
            bare.get_or_insert(core::mem::replace(&mut joint_fit, next));
            names.push(name);
            joint_fit = without_redundant(refit, joint_fit, bars.errors.clone(), &mut names)?;
            continue;
        }
        out_of_question.push(name.hypothesis.effect);
        rejected.push(name.hypothesis.clone());
        nearest.get_or_insert(Rejected {
            errors: bars.map_or_else(|| name.hypothesis.standard_errors(&[]), |bars| bars.errors),
            is_alternative: names.is_empty(),
            name,
        });
        if is_significant && !is_nameable {
            // The next best would be named in its place.
            break;
        }
    }
    Ok(Selection {
        joint_fit,
        bare,
        plain,
        unadjusted,
        names,
        nearest,
    })
}
