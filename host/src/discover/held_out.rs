//! Flights that have a vote.

use bodyflight_core::effect::Model;

use super::design::{Block, blocks, subject_places};
use super::fit::{Data, Values};
use super::null::floor;
use super::report::{Gap, HeldOutGap};
use super::stretch::{NUMBERS, Stretch, stretches};
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
        Self {
            track,
            model,
            pairs: blocks(
                track,
                &model,
                stretches(track),
                &Vec::new(),
                &subject_places(),
            ),
        }
    }

    fn data(&self) -> Data<'_> {
        Data {
            track: self.track,
            model: &self.model,
            stretches: &self.pairs,
        }
    }

    /// Misfit with some effects; what joints and subject have wrong acts as it does in that model.
    pub(super) fn misfit(&self, values: &Values) -> f64 {
        if values.is_empty() {
            return self.data().misfit(values, |_| true);
        }
        let pairs = self.data().moved_to(values);
        let data = Data {
            stretches: &pairs,
            ..self.data()
        };
        data.misfit(values, |_| true)
    }

    pub(super) fn gap(&self, values: &Values, seed: u64) -> HeldOutGap {
        let floor = floor(self.track, &self.pairs, &self.model, seed);
        HeldOutGap {
            misfit_before: self.misfit(&Vec::new()),
            misfit_after: self.misfit(values),
            numbers: self.pairs.len() * NUMBERS,
            gap: Gap::of(&self.data(), values, &floor),
        }
    }
}
