//! Flights that have a vote.

use bodyflight_core::effect::Model;

use super::design::{Block, blocks};
use super::fit::{Data, Values};
use super::report::{Gap, HeldOutGap};
use super::stretch::{Channels, NUMBERS, Stretch, stretches};
use super::track::Track;

/// A flight that effects are not fitted to, but have to help in.
pub(super) struct HeldOut<'a> {
    track: &'a Track,
    model: Model<f64>,
    pairs: Vec<(Stretch, Block)>,
}

impl<'a> HeldOut<'a> {
    pub(super) fn new(track: &'a Track) -> Self {
        let model = Model::new(track.dynamics, track.start_height());
        let stretches = stretches(track);
        let around = blocks(track, &stretches, &model, &|effect| effect.neutral());
        Self {
            track,
            model,
            pairs: stretches.into_iter().zip(around).collect(),
        }
    }

    fn data(&self) -> Data<'_> {
        Data {
            track: self.track,
            model: &self.model,
            stretches: &self.pairs,
        }
    }

    pub(super) fn misfit(&self, values: &Values) -> f64 {
        self.data().misfit(values, |_| true)
    }

    pub(super) fn gap(&self, values: &Values, floor: &Channels) -> HeldOutGap {
        HeldOutGap {
            misfit_before: self.misfit(&Vec::new()),
            misfit_after: self.misfit(values),
            numbers: self.pairs.len() * NUMBERS,
            gap: Gap::of(&self.data(), values, floor),
        }
    }
}
