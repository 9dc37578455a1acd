//! How far simulation and measurement are apart: by channel, before and after, here and in flights held out, and where.

use bodyflight_core::effect::Model;
use nalgebra::DVector;
use rayon::prelude::*;
use serde::Serialize;

use super::effect_set::{EffectSet, extended};
use super::fit::Data;
use super::flown::Prepared;
use super::linearization::Part;
use super::nuisance::Nuisance;
use super::stretch::{CHANNELS, Channels, Stretch};
use super::track::Track;

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

/// What the model misses in a stretch, joints and subject as in the files.
pub(super) fn missing(track: &Track, stretch: &Stretch, model: &Model<f64>) -> DVector<f64> {
    let flight = Prepared::new(track, stretch, model, &Nuisance::none(), 1);
    flight.fly(&Channels::zeros()).missing(track, stretch)
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
    pub(super) fn of(data: &Data<'_>, effects: &EffectSet, floor: &Channels) -> Self {
        let of = |model: &Model<f64>| {
            let residuals: Vec<_> = data
                .linearization
                .parts
                .par_iter()
                .map(|(stretch, _)| missing(data.track, stretch, model))
                .collect();
            mean_square(&residuals.iter().collect::<Vec<_>>())
        };
        let (before, after) = (of(data.model), of(&extended(data.model, effects)));
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
    /// What the misfit is where nothing is missing.
    pub misfit_expected: f64,
    /// By channel.
    pub gap: Gap,
}

impl HeldOutGap {
    /// Share of the misfit above that of noise which the effects take away, at most one.
    pub fn closed_share(&self) -> f64 {
        let above = (self.misfit_before - self.misfit_expected).max(1.0);
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

pub(super) fn map(data: &Data<'_>, effects: &EffectSet, floor: &Channels) -> Vec<Spot> {
    let extended = extended(data.model, effects);
    let spot = |(stretch, _): &Part| {
        let track = data.track;
        let over_floor = |model: &Model<f64>| -> [f64; CHANNELS] {
            let squares = mean_square(&[&missing(track, stretch, model)]);
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
    data.linearization.parts.iter().map(spot).collect()
}
