//! The search in the fall of a point.

use bodyflight_core::dynamics::Dynamics;

use super::candidate::{CANDIDATES, Candidate, Fit, effects_of};
use super::fall::Fall;
use super::report::{Found, Gain, Report};
use super::track::Track;
use crate::criteria::{SIGNIFICANT_ALONE, VOTE};
use crate::effect_set::EffectSet;
use crate::error::Result;
use crate::statistics::deviations;

/// Significance, in standard deviations, that suffices if other falls confirm the effect.
const SIGNIFICANT_WITH_VOTES: f64 = 4.5;

/// Searches the free fall of a track for effects that the model of a point lacks.
///
/// `dynamics` is the model at the height at which the fall starts.
///
/// # Errors
/// Returns an error if no free fall is long enough.
pub fn discover(
    track: &Track,
    held_out: &[Track],
    dynamics: &dyn Fn(f64) -> Dynamics<f64>,
    max_effects: usize,
) -> Result<Report> {
    let fall = Fall::new(track, dynamics)?;
    let others = held_out
        .iter()
        .map(|track| Fall::new(track, dynamics))
        .collect::<Result<Vec<_>>>()?;
    let plain = fall.misfit(&EffectSet::new());
    let mut found = Found {
        chosen: Fit {
            found: Vec::new(),
            errors: Vec::new(),
            misfit: plain,
        },
        gains: Vec::new(),
        plain,
        disagreement: (plain - fall.rows()) / (2.0 * fall.rows()).sqrt(),
    };
    while found.chosen.found.len() < max_effects.min(CANDIDATES.len()) {
        let Some((gain, fit)) = next(&fall, &others, &found.chosen) else {
            break;
        };
        found.gains.push(gain);
        found.chosen = fit;
    }
    Ok(Report::new(&fall, &others, track, found))
}

/// The effect that explains most of the residual, fitted together with those already chosen. Returns `None` if no
/// effect is significant.
fn next(fall: &Fall<'_>, others: &[Fall<'_>], chosen: &Fit) -> Option<(Gain, Fit)> {
    let known = |candidate: &&Candidate| {
        let own = |(found, _): &(Candidate, _)| found.effect == candidate.effect;
        !chosen.found.iter().any(own)
    };
    let tried = CANDIDATES.iter().filter(known).map(|candidate| {
        let mut found = chosen.found.clone();
        found.push((*candidate, candidate.neutral()));
        (candidate, fall.fit(found))
    });
    let (candidate, fit) = tried.min_by(|a, b| a.1.misfit.total_cmp(&b.1.misfit))?;
    // Misfit that nothing explains also raises gains by chance.
    let scale = (fit.misfit / fall.rows()).max(1.0);
    let beyond_chance = |gain: f64| deviations(gain / scale, candidate.count as f64);
    let gain = chosen.misfit - fit.misfit;
    let mut votes = others.iter().map(|other| {
        let misfit = |fit: &Fit| other.misfit(&effects_of(&fit.found));
        beyond_chance(misfit(chosen) - misfit(&fit))
    });
    let least = if others.is_empty() {
        SIGNIFICANT_ALONE
    } else {
        SIGNIFICANT_WITH_VOTES
    };
    let deviations = beyond_chance(gain);
    if deviations < least || votes.any(|vote| vote < VOTE) {
        return None;
    }
    let gain = Gain {
        effect: candidate.effect,
        deviations,
        misfit: gain,
    };
    Some((gain, fit))
}
