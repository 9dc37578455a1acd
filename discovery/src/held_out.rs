//! Flights that have a vote.

use bodyflight_core::effect::Model;

use super::effect_set::{EffectSet, extended};
use super::fit::Data;
use super::gap::{Gap, HeldOutGap};
use super::linearization::Linearization;
use super::nuisance::Nuisance;
use super::null_distribution::expected;
use super::stretch::stretches;
use super::track::Track;

/// A flight that effects are not fitted to, but have to help in.
pub(super) struct HeldOut<'a> {
    track: &'a Track,
    /// Without anything found.
    bare: Model<f64>,
    /// With the errors of sensors that the data alone show.
    model: Model<f64>,
    linearization: Linearization,
}

impl<'a> HeldOut<'a> {
    pub(super) fn new(track: &'a Track, faults: &EffectSet) -> Self {
        let bare = Model::new(track.dynamics, track.start_height());
        let model = extended(&bare, faults);
        let start = (&Vec::new(), &Nuisance::none());
        Self {
            track,
            bare,
            model,
            linearization: Linearization::new(track, &model, stretches(track), start, &[]),
        }
    }

    fn data(&self) -> Data<'_> {
        Data {
            track: self.track,
            model: &self.model,
            linearization: &self.linearization,
        }
    }

    /// Misfit with some effects beside the errors of sensors, joints and subject fitted to this flight.
    pub(super) fn misfit(&self, effects: &EffectSet) -> f64 {
        self.misfit_of(&self.model, effects)
    }

    fn misfit_of(&self, plain: &Model<f64>, effects: &EffectSet) -> f64 {
        let data = Data {
            model: plain,
            ..self.data()
        };
        data.profiled_relinearized(effects).0.misfit
    }

    /// What `effects`, all that were found, do here.
    pub(super) fn gap(&self, effects: &EffectSet, seed: u64) -> HeldOutGap {
        let data = Data {
            model: &self.bare,
            ..self.data()
        };
        let linearization = data.linearized_at(effects, &Nuisance::none(), &[]);
        let model = extended(&self.bare, effects);
        let (misfit_expected, floor) = expected(self.track, &linearization, &model, seed);
        HeldOutGap {
            misfit_before: self.misfit_of(&self.bare, &Vec::new()),
            misfit_after: self.misfit_of(&self.bare, effects),
            misfit_expected,
            gap: Gap::of(&data, effects, &floor),
        }
    }
}
