//! What was found in the recording of a point.

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

/// Shortest fall in which names are given (s).
const ENOUGH: f64 = 20.0;

/// Names of the components, with units.
pub const COMPONENT_NAMES: [&str; 3] =
    ["velocity_north_mps", "velocity_west_mps", "velocity_up_mps"];

/// One window of the free fall.
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Spot {
    /// Begin (s from that of the fall).
    pub time_s: f64,
    /// Height above mean sea level (m).
    pub height_m: f64,
    /// Speed over ground (m/s).
    pub speed_mps: f64,
    /// Change of velocity that the plain model misses (m/s).
    pub missing: [f64; 3],
    /// The same with the effects named.
    pub missing_after: [f64; 3],
}

/// Root mean squares of what is missing in a window, by component (m/s).
#[derive(Debug, Clone, PartialEq, JsonSchema, Serialize)]
pub struct Gap {
    /// Of the plain model.
    pub before: [f64; 3],
    /// With the effects named.
    pub after: [f64; 3],
    /// Of noise and unknown posture.
    pub floor: [f64; 3],
    /// Sum of squares in deviations, posture taken out, of the plain model.
    pub misfit_before: f64,
    /// With the effects named.
    pub misfit_after: f64,
    /// Where nothing is missing.
    pub misfit_expected: f64,
    /// Share of the misfit above the expected one that is closed.
    pub closed_share: f64,
}

/// Delay of the receiver, from positions and velocities.
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct Latency {
    /// Delay of the velocity (s).
    pub latency_s: f64,
    /// Its standard error (s).
    pub standard_error_s: f64,
}

/// Mean size of the specific force in the fall, by the inertial sensor and by the satellites (m/s2).
#[derive(Debug, Clone, Copy, PartialEq, JsonSchema, Serialize)]
pub struct SpecificForce {
    /// Of the inertial sensor.
    pub inertial_mps2: f64,
    /// Of the changes of velocity over windows.
    pub satellites_mps2: f64,
}

/// What discovery found.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Report {
    /// How it ended.
    pub verdict: Outcome,
    /// Effects that were named.
    pub effects: Vec<Named>,
    /// What came nearest where the verdict is not `named`.
    pub nearest: Vec<Named>,
    /// Share of what there was to explain that they explain.
    pub explained: f64,
    /// Deviations by which the misfit is beyond that of a fall in which nothing is missing.
    pub disagreement: f64,
    /// Length of the free fall (s).
    pub free_fall_s: f64,
    /// Noise of one component of the velocity (m/s).
    pub noise_mps: f64,
    /// Rows of the files that were not usable.
    pub rows_skipped: usize,
    /// Whether positions and velocities agree.
    pub latency: Option<Latency>,
    /// Whether the inertial sensor agrees, where there is one.
    pub specific_force: Option<SpecificForce>,
    /// Gap of the fall.
    pub gap: Gap,
    /// Gaps of the falls held out.
    pub held_out: Vec<Gap>,
    /// Window by window.
    pub residual_map: Vec<Spot>,
    /// The effects as in `model.toml`.
    pub model: Vec<ByName>,
}

/// What an effect explains.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain {
    pub(super) effect: Effect,
    /// Deviations beyond chance.
    pub(super) deviations: f64,
    /// What it takes off the misfit.
    pub(super) misfit: f64,
}

pub(super) struct Found {
    pub(super) chosen: Fit,
    /// Of each effect.
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

/// The effects with parameters and errors, these widened by the misfit that is left.
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
    // Variance of the rows by noise and posture.
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

/// By how much the velocity is late: the way over windows is that of the velocity, less the delay times its change.
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
