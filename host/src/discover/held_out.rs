//! Flights that have a vote.

use bodyflight_core::effect::Model;

use super::design::{Block, blocks, subject_places};
use super::fit::{Data, Values, with};
use super::null::floor;
use super::report::{Gap, HeldOutGap};
use super::stretch::{NUMBERS, Stretch, stretches};
use super::track::Track;

/// A flight that effects are not fitted to, but have to help in.
pub(super) struct HeldOut<'a> {
    track: &'a Track,
    /// Without anything found.
    bare: Model<f64>,
    /// With the errors of sensors that the data alone show.
    model: Model<f64>,
    pairs: Vec<(Stretch, Block)>,
}

impl<'a> HeldOut<'a> {
    pub(super) fn new(track: &'a Track, faults: &Values) -> Self {
        let bare = Model::new(track.dynamics, track.start_height());
        let model = with(&bare, faults);
        Self {
            track,
            bare,
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

    /// Misfit with some effects beside the errors of sensors; what joints and subject have wrong acts as it does in
    /// that model.
    pub(super) fn misfit(&self, values: &Values) -> f64 {
        self.misfit_of(&self.model, values)
    }

    fn misfit_of(&self, plain: &Model<f64>, values: &Values) -> f64 {
        let data = Data {
            model: plain,
            ..self.data()
        };
        let pairs = data.moved_to(values);
        let data = Data {
            stretches: &pairs,
            ..data
        };
        data.misfit(values, |_| true)
    }

    /// What `values`, all that was found, do here.
    pub(super) fn gap(&self, values: &Values, seed: u64) -> HeldOutGap {
        let data = Data {
            model: &self.bare,
            ..self.data()
        };
        let floor = floor(self.track, &self.pairs, &self.model, seed);
        HeldOutGap {
            misfit_before: self.misfit_of(&self.bare, &Vec::new()),
            misfit_after: self.misfit_of(&self.bare, values),
            numbers: self.pairs.len() * NUMBERS,
            gap: Gap::of(&data, values, &floor),
        }
    }
}
