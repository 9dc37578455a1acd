//! What discovery found, in numbers for people and machines.

use bodyflight_core::effect::{Effect, Model};
use nalgebra::DVector;
use rayon::prelude::*;
use serde::{Serialize, Serializer};

use super::check::{Check, Finding};
use super::fit::{Data, Fit, Values, with};
use super::null::Null;
use super::stretch::{CHANNELS, Channels, Prepared, Stretch};
use super::track::Track;

/// Names of the channels, with units.
pub const CHANNEL_NAMES: [&str; CHANNELS] = [
    "attitude_x_rad",
    "attitude_y_rad",
    "attitude_z_rad",
    "angular_velocity_x_rad_s",
    "angular_velocity_y_rad_s",
    "angular_velocity_z_rad_s",
    "velocity_north_m_s",
    "velocity_west_m_s",
    "velocity_up_m_s",
];

/// How a search ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// Effects were found that explain the disagreement.
    Named,
    /// Model and data agree to the noise.
    None,
    /// There is a disagreement, and nothing in the library explains it.
    Unexplained,
    /// Not enough excitation to tell effects apart.
    Thin,
}

/// Another effect that explains as much.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Rival {
    /// Its name.
    pub name: &'static str,
    /// What it explains, over what the named one does.
    pub share: f64,
}

/// Numbers by name as a map, in their order.
fn by_name<S: Serializer>(
    numbers: &[(&'static str, f64)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(numbers.iter().copied())
}

/// An effect that was named.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named {
    /// Its name.
    pub name: &'static str,
    /// Parameters by name.
    #[serde(serialize_with = "by_name")]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "by_name")]
    pub standard_errors: Vec<(&'static str, f64)>,
    /// Deviations by which its gain is beyond chance.
    pub confidence: f64,
    /// Share of what was left to explain.
    pub explains: f64,
    /// Effects that cannot be told from it on this flight.
    pub rivals: Vec<Rival>,
    /// The maneuver that would tell them apart.
    pub separated_by: &'static str,
    /// Whether conscious muscle input or damping could imitate it, so that an estimator would take it for that.
    pub imitated_by_inputs: bool,
    #[serde(skip)]
    effect: Effect,
}

impl Named {
    pub(super) fn new(effect: Effect, confidence: f64, explains: f64, rivals: Vec<Rival>) -> Self {
        let description = effect.description();
        let inputs = [Effect::Muscle, Effect::Damping].map(|input| input.description().name);
        let imitated = |name: &str| inputs.contains(&name);
        Self {
            name: description.name,
            parameters: Vec::new(),
            standard_errors: Vec::new(),
            confidence,
            explains,
            imitated_by_inputs: description.confused_with.iter().any(|name| imitated(name))
                || rivals.iter().any(|rival| imitated(rival.name)),
            rivals,
            separated_by: description.separated_by,
            effect,
        }
    }
}

impl Named {
    /// An error of a sensor that the data alone show.
    pub(super) fn by_check(check: &Check) -> Self {
        let names = check.effect.description().parameters.iter().map(|p| p.name);
        Self {
            parameters: names.clone().zip(check.values).collect(),
            standard_errors: names.zip(check.errors).collect(),
            ..Self::new(check.effect, check.deviations, 0.0, Vec::new())
        }
    }

    pub(super) const fn effect(&self) -> Effect {
        self.effect
    }
}

/// Fills in the parameters of the last, joint fit.
///
/// Errors are widened by what the fit cannot know: by how much an effect gains through joints that are wrong in
/// ways that are not linear, and by the misfit that is left.
pub(super) fn settle(named: &mut [Named], fit: &Fit, null: &Null) {
    let left = (fit.misfit / null.misfit[0].max(1.0)).max(1.0);
    let mut errors = fit.errors.iter();
    for (effect, values) in &fit.values {
        let parameters = effect.description().parameters;
        let widened = (null.inflation_of(*effect) * left).sqrt();
        let errors = errors.by_ref().take(parameters.len());
        let errors: Vec<_> = parameters
            .iter()
            .zip(errors)
            .map(|(p, e)| (p.name, e * widened))
            .collect();
        for named in named.iter_mut().filter(|named| named.effect == *effect) {
            named.parameters = parameters
                .iter()
                .zip(values)
                .map(|(p, v)| (p.name, *v))
                .collect();
            named.standard_errors = errors.clone();
        }
    }
}

/// Root mean squares of the residuals by channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gap {
    /// Of the plain model.
    pub before: [f64; CHANNELS],
    /// With the effects named.
    pub after: [f64; CHANNELS],
    /// Where nothing is missing: noise, and what subject and joints have wrong.
    pub floor: [f64; CHANNELS],
    /// Share of the gap above the floor that was closed, all channels in units of their floor.
    pub closed_share: f64,
}

/// Mean square of each channel.
pub(super) fn mean_square(residuals: &[&DVector<f64>]) -> Channels {
    let mut squares = Channels::zeros();
    let mut count = 0.0;
    for residual in residuals {
        for row in residual.as_slice().chunks_exact(CHANNELS) {
            squares += Channels::from_column_slice(row).map(|value| value * value);
            count += 1.0;
        }
    }
    if count > 0.0 {
        squares / count
    } else {
        squares
    }
}

impl Gap {
    pub(super) fn of(data: &Data<'_>, values: &Values, floor: &Channels) -> Self {
        let stretches: Vec<Stretch> = data
            .stretches
            .iter()
            .map(|(stretch, _)| stretch.clone())
            .collect();
        Self::without_columns(data.track, data.model, &stretches, values, floor)
    }

    pub(super) fn without_columns(
        track: &Track,
        model: &Model<f64>,
        stretches: &[Stretch],
        values: &Values,
        floor: &Channels,
    ) -> Self {
        let of = |model: &Model<f64>| {
            let residuals: Vec<_> = stretches
                .par_iter()
                .map(|stretch| {
                    Prepared::new(track, stretch, model, &|posture| posture)
                        .residual(&Channels::zeros())
                })
                .collect();
            mean_square(&residuals.iter().collect::<Vec<_>>())
        };
        let (before, after) = (of(model), of(&with(model, values)));
        let (mut open, mut left) = (0.0, 0.0);
        for channel in 0..CHANNELS {
            let least = floor[channel] * floor[channel];
            open += (before[channel] / least - 1.0).max(0.0);
            left += (after[channel] / least - 1.0).max(0.0);
        }
        let roots = |squares: &Channels| squares.map(f64::sqrt).into();
        Self {
            before: roots(&before),
            after: roots(&after),
            floor: (*floor).into(),
            closed_share: if open > 0.0 { 1.0 - left / open } else { 0.0 },
        }
    }
}

/// What effects do in a flight that they were not fitted to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOutGap {
    /// Misfit of the plain model: sum of squares in deviations.
    pub misfit_before: f64,
    /// With the effects named.
    pub misfit_after: f64,
    /// Numbers compared: what the misfit is where nothing is missing.
    pub numbers: usize,
    /// By channel.
    pub gap: Gap,
}

impl HeldOutGap {
    /// Share of the misfit above that of noise which the effects take away, at most one.
    pub fn closed_share(&self) -> f64 {
        let above = (self.misfit_before - self.numbers as f64).max(1.0);
        ((self.misfit_before - self.misfit_after) / above).min(1.0)
    }
}

/// Where the plain model disagrees: one stretch.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Spot {
    /// Begin of the stretch (s).
    pub time_s: f64,
    /// Root mean square of each channel over its floor, of the plain model.
    pub over_floor: [f64; CHANNELS],
    /// The same with the effects named.
    pub over_floor_after: [f64; CHANNELS],
    /// Mean speed (m/s).
    pub speed_m_s: f64,
    /// Mean size of the angular velocity (rad/s).
    pub turn_rad_s: f64,
    /// Mean height (m).
    pub height_m: f64,
}

pub(super) fn map(data: &Data<'_>, values: &Values, floor: &Channels) -> Vec<Spot> {
    let extended = with(data.model, values);
    let spot = |(stretch, _): &(Stretch, super::design::Block)| {
        let track = data.track;
        let over_floor = |model: &Model<f64>| -> [f64; CHANNELS] {
            let flown = Prepared::new(track, stretch, model, &|posture| posture);
            let squares = mean_square(&[&flown.residual(&Channels::zeros())]);
            squares.map(f64::sqrt).component_div(floor).into()
        };
        let motions = &track.measured[stretch.first..stretch.first + super::stretch::FRAMES];
        let mean = |value: &dyn Fn(&bodyflight_core::dynamics::Motion<f64>) -> f64| {
            motions.iter().map(value).sum::<f64>() / motions.len() as f64
        };
        Spot {
            time_s: track.times[stretch.first],
            over_floor: over_floor(data.model),
            over_floor_after: over_floor(&extended),
            speed_m_s: mean(&|motion| motion.velocity.components.norm()),
            turn_rad_s: mean(&|motion| motion.angular_velocity.components.norm()),
            height_m: mean(&|motion| motion.position.components.z),
        }
    };
    data.stretches.iter().map(spot).collect()
}

/// An error of a sensor that the data alone show, rule out, or do not decide.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Checked {
    /// Name of the effect.
    pub name: &'static str,
    /// What came of it.
    pub finding: Finding,
    /// Parameters by name.
    #[serde(serialize_with = "by_name")]
    pub parameters: Vec<(&'static str, f64)>,
    /// Their standard errors.
    #[serde(serialize_with = "by_name")]
    pub standard_errors: Vec<(&'static str, f64)>,
}

impl Checked {
    fn of(check: &Check) -> Self {
        let named = Named::by_check(check);
        Self {
            name: named.name,
            finding: check.finding,
            parameters: named.parameters,
            standard_errors: named.standard_errors,
        }
    }
}

/// What discovery found.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// How it ended.
    pub verdict: Outcome,
    /// Effects that were named, in the order in which they were found.
    pub effects: Vec<Named>,
    /// What came nearest where the verdict is not `named`; not in the model.
    pub nearest: Vec<Named>,
    /// Share of what there was to explain that effects or nearest explain.
    pub explained: f64,
    /// Deviations by which the misfit of the plain model is beyond that of flights in which nothing is missing.
    pub disagreement: f64,
    /// Gap of the flight.
    pub gap: Gap,
    /// Gaps of the flights held out.
    pub held_out: Vec<HeldOutGap>,
    /// Where the plain model disagrees.
    pub residual_map: Vec<Spot>,
    /// What sensors say of one another.
    pub checks: Vec<Checked>,
    /// The effects as in `model.toml`.
    pub model: Vec<(&'static str, Vec<(&'static str, f64)>)>,
}

pub(super) struct Parts {
    pub(super) outcome: Outcome,
    pub(super) named: Vec<Named>,
    pub(super) explained: f64,
    pub(super) disagreement: f64,
    pub(super) gap: Gap,
    pub(super) held_out: Vec<HeldOutGap>,
    pub(super) map: Vec<Spot>,
    pub(super) values: Values,
    pub(super) checks: Vec<Check>,
}

impl Report {
    pub(super) fn new(parts: Parts) -> Self {
        let model = parts.values.iter().map(|(effect, values)| {
            let description = effect.description();
            let parameters = description.parameters.iter().zip(values);
            (
                description.name,
                parameters.map(|(p, v)| (p.name, *v)).collect(),
            )
        });
        let (effects, nearest) = match parts.outcome {
            Outcome::Named => (parts.named, Vec::new()),
            _ => (Vec::new(), parts.named),
        };
        Self {
            verdict: parts.outcome,
            effects,
            nearest,
            explained: parts.explained,
            disagreement: parts.disagreement,
            gap: parts.gap,
            held_out: parts.held_out,
            residual_map: parts.map,
            checks: parts.checks.iter().map(Checked::of).collect(),
            model: model.collect(),
        }
    }

    /// The effects as a `model.toml`.
    pub fn model_toml(&self) -> String {
        let mut text = String::from("# Effects found by bodyflight discover.\n");
        for (name, parameters) in &self.model {
            text.push_str(&format!("\n[[effect]]\nname = \"{name}\"\n"));
            for (parameter, value) in parameters {
                text.push_str(&format!("{parameter} = {value:?}\n"));
            }
        }
        text
    }
}
