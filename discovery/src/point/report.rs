//! The report on the track of a point.

use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::Serialize;

use super::candidate::{Candidate, Fit, effects_of};
use super::fall::Fall;
use super::track::Track;
use crate::criteria::{DISAGREES, EXPLAINS};
use crate::effect_set::EffectSet;
use crate::report::{ByName, Evidence, Named, Outcome, model_of, share_explained};

/// Minimum duration of a fall in which effects are named (s).
const ENOUGH: f64 = 20.0;

/// Names of the components, with units.
pub const COMPONENT_NAMES: [&str; 3] =
    ["velocity_north_mps", "velocity_west_mps", "velocity_up_mps"];

/// One window of the free fall.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Spot {
    /// Start, from the beginning of the fall (s).
    pub time_s: f64,
    /// Height above mean sea level (m).
    pub height_m: f64,
    /// Speed over ground (m/s).
    pub speed_mps: f64,
    /// Change of velocity that the plain model does not explain (m/s).
    pub missing: [f64; 3],
    /// The same with the named effects.
    pub missing_after: [f64; 3],
}

/// Root-mean-square residuals of the windows, by component (m/s).
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Gap {
    /// The plain model.
    pub before: [f64; 3],
    /// With the named effects.
    pub after: [f64; 3],
    /// Expected from noise and unknown posture.
    pub floor: [f64; 3],
    /// Whitened sum of squares of the plain model, with the posture marginalized out.
    pub misfit_before: f64,
    /// The same with the named effects.
    pub misfit_after: f64,
    /// The same if the model were exact.
    pub misfit_expected: f64,
    /// Share of the excess misfit that was closed.
    pub closed_share: f64,
}

/// Delay of the receiver, found by comparing positions with velocities.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct Latency {
    /// Delay of the velocity (s).
    pub latency_s: f64,
    /// Its standard error (s).
    pub standard_error_s: f64,
}

/// Mean magnitude of the specific force in the fall, as measured by the inertial sensor and derived from the satellite
/// fixes (m/s2).
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct SpecificForce {
    /// From the inertial sensor.
    pub inertial_mps2: f64,
    /// From the change of velocity over windows.
    pub satellites_mps2: f64,
}

/// The report of a search.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Report {
    /// The outcome.
    pub verdict: Outcome,
    /// The named effects.
    pub effects: Vec<Named>,
    /// The closest candidates if the verdict is not `named`.
    pub nearest: Vec<Named>,
    /// Share of the excess misfit that the effects explain.
    pub explained: f64,
    /// Standard deviations by which the misfit exceeds that of an exact model.
    pub disagreement: f64,
    /// Duration of the free fall (s).
    pub free_fall_s: f64,
    /// Noise of one velocity component (m/s).
    pub noise_mps: f64,
    /// Number of rows of the files that were unusable.
    pub rows_skipped: usize,
    /// The delay of velocities relative to positions.
    pub latency: Option<Latency>,
    /// Comparison with the inertial sensor, if there is one.
    pub specific_force: Option<SpecificForce>,
    /// The gap of the fall.
    pub gap: Gap,
    /// The gaps of the held-out falls.
    pub held_out: Vec<Gap>,
    /// The residual of each window.
    pub residual_map: Vec<Spot>,
    /// The effects as written to `model.toml`.
    pub model: Vec<ByName>,
}

/// Gain of an effect.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain {
    pub(super) effect: Effect,
    /// Significance, in standard deviations.
    pub(super) deviations: f64,
    /// Reduction of the misfit.
    pub(super) misfit: f64,
}

pub(super) struct Found {
    pub(super) chosen: Fit,
    /// One for each effect.
    pub(super) gains: Vec<Gain>,
    pub(super) plain: f64,
    pub(super) disagreement: f64,
}

impl Report {
    pub(super) fn new(fall: &Fall<'_>, others: &[Fall<'_>], track: &Track, found: Found) -> Self {
        let Found {
            chosen,
            gains,
            plain,
            disagreement,
        } = found;
        let expected = fall.rows();
        let explained = share_explained(plain, chosen.misfit, expected);
        let named = named(&chosen, &gains, plain, expected);
        let thin = fall.duration() < ENOUGH;
        let agrees = disagreement < DISAGREES;
        let at_limit = named.iter().any(|named| named.at_limit);
        let enough = !at_limit && (agrees || explained >= EXPLAINS);
        let verdict = Outcome::of(thin, agrees, &named, enough);
        let model = match verdict {
            Outcome::Named => effects_of(&chosen.found),
            _ => EffectSet::new(),
        };
        let (effects, nearest) = verdict.split(named);
        Self {
            verdict,
            effects,
            nearest,
            explained,
            disagreement,
            free_fall_s: fall.duration(),
            noise_mps: fall.noise,
            rows_skipped: track.rows_skipped,
            latency: latency(fall),
            specific_force: specific_force(fall, track),
            gap: gap(fall, &model),
            held_out: others.iter().map(|other| gap(other, &model)).collect(),
            residual_map: map(fall, &model),
            model: model_of(&model),
        }
    }
}

/// The effects with their parameters and standard errors, which are widened by the remaining misfit.
fn named(chosen: &Fit, gains: &[Gain], plain: f64, expected: f64) -> Vec<Named> {
    let left = (chosen.misfit / expected).max(1.0).sqrt();
    let mut errors = chosen.errors.iter();
    let one = |(candidate, numbers): &(Candidate, Vec<f64>)| {
        let own: Vec<f64> = errors.by_ref().take(numbers.len()).copied().collect();
        let gain = gains.iter().find(|gain| gain.effect == candidate.effect)?;
        let evidence = Evidence {
            deviations: gain.deviations,
            chance: None,
            stability: None,
            explains: gain.misfit / (plain - expected).max(1.0),
        };
        let tied = |of: &[f64]| -> [f64; PARAMETER_COUNT] { candidate.ties.map(|tie| of[tie]) };
        let (values, errors) = (tied(numbers), tied(&own).map(|error| error * left));
        Some(Named::new(candidate.effect, evidence, Vec::new()).with_parameters(&values, &errors))
    };
    chosen.found.iter().filter_map(one).collect()
}

fn gap(fall: &Fall<'_>, effects: &EffectSet) -> Gap {
    let of = |effects: &EffectSet| -> [f64; 3] {
        let rows = fall.residuals(effects);
        let squares = rows
            .iter()
            .fold(Vector3::zeros(), |sum, row| sum + row.component_mul(row));
        (squares / rows.len().max(1) as f64).map(f64::sqrt).into()
    };
    // Variance of the rows from noise and posture.
    let mut floor = Vector3::zeros();
    for (k, deviation) in fall.deviations.iter().enumerate() {
        let own = fall.nuisances.slopes().rows(3 * k, 3);
        let posture = Vector3::from_fn(|row, _| own.row(row).norm_squared());
        floor += (posture.add_scalar(1.0)) * (deviation * deviation);
    }
    let floor = (floor / fall.deviations.len().max(1) as f64).map(f64::sqrt);
    let (before, after) = (fall.misfit(&EffectSet::new()), fall.misfit(effects));
    let above = (before - fall.rows()).max(1.0);
    Gap {
        before: of(&EffectSet::new()),
        after: of(effects),
        floor: floor.into(),
        misfit_before: before,
        misfit_after: after,
        misfit_expected: fall.rows(),
        closed_share: ((before - after) / above).min(1.0),
    }
}

fn map(fall: &Fall<'_>, effects: &EffectSet) -> Vec<Spot> {
    let (before, after) = (fall.residuals(&EffectSet::new()), fall.residuals(effects));
    let spots = before.iter().zip(&after).enumerate();
    spots
        .map(|(k, (before, after))| {
            let fix = &fall.fixes[fall.windows[k].0];
            Spot {
                time_s: fall.time(k),
                height_m: fix.position.components.z,
                speed_mps: fix.velocity.components.norm(),
                missing: (*before).into(),
                missing_after: (*after).into(),
            }
        })
        .collect()
}

/// Delay of the velocity: displacements over windows are fitted by the integral of the velocity less the delay times
/// its change.
fn latency(fall: &Fall<'_>) -> Option<Latency> {
    let fixes = fall.fixes;
    let mut rows: Vec<(f64, f64)> = Vec::new();
    for &(from, to) in &fall.windows {
        let said = fixes[from..=to]
            .windows(2)
            .fold(Vector3::zeros(), |way, pair| {
                let mean = (pair[0].velocity.components + pair[1].velocity.components) * 0.5;
                way + mean * (pair[1].time - pair[0].time)
            });
        let way = fixes[to].position.components - fixes[from].position.components;
        let change = fixes[to].velocity.components - fixes[from].velocity.components;
        rows.extend((way - said).iter().copied().zip(change.iter().copied()));
    }
    let curvature: f64 = rows.iter().map(|(_, change)| change * change).sum();
    if rows.len() < 6 || curvature <= 0.0 {
        return None;
    }
    let slope: f64 = rows.iter().map(|(beyond, change)| beyond * change).sum();
    let latency = slope / curvature;
    let left: f64 = rows
        .iter()
        .map(|(beyond, change)| (beyond - latency * change).powi(2))
        .sum();
    Some(Latency {
        latency_s: latency,
        standard_error_s: (left / (rows.len() as f64 - 1.0) / curvature).sqrt(),
    })
}

fn specific_force(fall: &Fall<'_>, track: &Track) -> Option<SpecificForce> {
    let ends = fall.fixes.first().zip(fall.fixes.last())?;
    let (from, to) = (ends.0.time, ends.1.time);
    let sizes: Vec<f64> = track
        .specific_force
        .iter()
        .filter(|(time, _)| (from..=to).contains(time))
        .map(|(_, force)| force.norm())
        .collect();
    if sizes.is_empty() {
        return None;
    }
    let gravity = Vector3::new(0.0, 0.0, fall.plain.dynamics.gravity);
    let of_window = |&(from, to): &(usize, usize)| {
        let (from, to) = (&fall.fixes[from], &fall.fixes[to]);
        let change = to.velocity.components - from.velocity.components;
        (change / (to.time - from.time) + gravity).norm()
    };
    let windows = fall.windows.iter().map(of_window);
    Some(SpecificForce {
        inertial_mps2: sizes.iter().sum::<f64>() / sizes.len() as f64,
        satellites_mps2: windows.sum::<f64>() / fall.windows.len().max(1) as f64,
    })
}
