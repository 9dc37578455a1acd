//! Forward selection: errors are estimated first, then an effect is named if the flights, including those held out, are
//! much more likely with it than without it.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Effect, Kind};

use crate::error::{Error, Result};
use crate::hypotheses::backward_elimination::without_redundant;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::{
    BestHypothesis, Hypothesis, NamedEffect, Rejected, is_significant,
};
use crate::hypotheses::refit::Refit;
use crate::hypotheses::robust_covariance::error_bars;
use crate::hypotheses::runner_up::{SetAside, fitted_beside};
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
fn unpromising(hypothesis: Hypothesis) -> Rejected {
    Rejected {
        errors: hypothesis.standard_errors(&[]),
        name: NamedEffect {
            hypothesis,
            others: Vec::new(),
        },
        is_alternative: false,
    }
}

/// The best candidate in the first of two places in which one looks promising.
///
/// Fitted constants may have absorbed most of a missing effect, so effects are sought around the values in the files
/// first, beside those already named. The flights' own constants are tried next, because slopes may differ far from the
/// files. `files` is replaced if other effects have been named since.
fn sought<'a>(
    refit: &Refit<'a>,
    files: &mut JointFit<'a>,
    own: &JointFit<'a>,
    out_of_question: &[Effect],
) -> Result<Option<BestHypothesis>> {
    if files.effects != own.effects
        && let Some(beside) = refit.around_files(own)?
    {
        *files = beside;
    }
    let mut found: Option<BestHypothesis> = None;
    for (around_files, from) in [(true, &*files), (false, own)] {
        if from.effects != own.effects {
            continue;
        }
        let hypotheses = from.hypotheses(out_of_question, refit.progress)?;
        let Some(hypothesis) = hypotheses.iter().find(|one| one.matters()).cloned() else {
            continue;
        };
        let is_promising = hypothesis.is_promising();
        if is_promising || found.is_none() {
            found = Some(BestHypothesis {
                hypothesis,
                hypotheses,
                around_files,
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

/// Names effects one after the other, while one is significant.
///
/// # Errors
/// Returns an error if the search was cancelled.
pub(crate) fn selected<'a>(
    refit: &Refit<'a>,
    alone: Vec<FitWithoutEffects>,
    max_effects: usize,
) -> Result<Selection<'a>> {
    let none = EffectSet::new();
    let each = alone.into_iter();
    let each = each.map(|alone| (alone.around_files, alone.settled));
    let (files, settled): (Vec<LinearFit>, Vec<LinearFit>) = each.unzip();
    let unadjusted = unadjusted(files.get(..refit.count).unwrap_or(&files));
    let mut files = refit.joint_fit(files, none.clone());
    let mut joint_fit = refit.joint_fit(settled, none);
    let mut plain: Option<Vec<FittedErrors>> = None;
    let mut names: Vec<NamedEffect> = Vec::new();
    let mut bare: Option<JointFit<'a>> = None;
    let mut nearest: Option<Rejected> = None;
    let mut out_of_question: Vec<Effect> = Vec::new();
    let mut set_aside: Vec<SetAside> = Vec::new();
    while names.len() < max_effects && out_of_question.len() < DECISION.rejections {
        begin(refit.progress, "comparing the effects of the library")?;
        let tried = names.len() + out_of_question.len();
        let found = sought(refit, &mut files, &joint_fit, &out_of_question)?;
        reached(refit.progress, tried, 0.3);
        let Some(found) = found else {
            break;
        };
        if !found.hypothesis.is_promising() {
            nearest.get_or_insert_with(|| unpromising(found.hypothesis));
            break;
        }
        let first_order = found.hypothesis.clone();
        let (mut name, next) = fitted_beside(refit, &files, &mut joint_fit, found, &mut set_aside)?;
        reached(refit.progress, tried, 1.0);
        let bars = next
            .as_ref()
            .map(|next| error_bars(next, refit.progress))
            .unwrap_or_default();
        let judged = bars.judged(name.hypothesis);
        name.hypothesis = joint_fit.checked_without_refit(judged, refit.progress);
        let is_significant = next.is_some() && is_significant(&name.hypothesis);
        let is_nameable = is_nameable(&joint_fit, name.hypothesis.effect) && name.is_likeliest();
        if let Some(next) = next
            && is_significant
            && is_nameable
        {
            let others = set_aside.drain(..).map(|one| one.refitted);
            name.others.extend(others);
            if plain.is_none() {
                plain = joint_fit.without_wrench(refit.progress)?;
            }
            bare.get_or_insert(core::mem::replace(&mut joint_fit, next));
            names.push(name);
            joint_fit = without_redundant(refit, joint_fit, bars, &mut names)?;
            continue;
        }
        out_of_question.push(name.hypothesis.effect);
        set_aside.push(SetAside {
            first_order,
            refitted: name.hypothesis.clone(),
        });
        nearest.get_or_insert(Rejected {
            errors: bars.errors_beside(&name.hypothesis),
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
