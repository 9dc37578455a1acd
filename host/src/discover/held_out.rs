//! Flights that have a vote.

use bodyflight_core::effect::Model;

use super::design::Around;
use super::fit::{Data, Values, with};
use super::gap::{Gap, HeldOutGap};
use super::null::expected;
use super::stretch::stretches;
use super::tolerance::Wrong;
use super::track::Track;

/// A flight that effects are not fitted to, but have to help in.
pub(super) struct HeldOut<'a> {
    track: &'a Track,
    /// Without anything found.
    bare: Model<f64>,
    /// With the errors of sensors that the data alone show.
    model: Model<f64>,
    around: Around,
}

impl<'a> HeldOut<'a> {
    pub(super) fn new(track: &'a Track, faults: &Values) -> Self {
        let bare = Model::new(track.dynamics, track.start_height());
        let model = with(&bare, faults);
        let start = (&Vec::new(), &Wrong::nothing());
        Self {
            track,
            bare,
            model,
            around: Around::new(track, &model, stretches(track), start, &[]),
        }
    }

    fn data(&self) -> Data<'_> {
        Data {
            track: self.track,
            model: &self.model,
            around: &self.around,
        }
    }

    /// Misfit with some effects beside the errors of sensors, joints and subject fitted to this flight.
    pub(super) fn misfit(&self, values: &Values) -> f64 {
        self.misfit_of(&self.model, values)
    }

    fn misfit_of(&self, plain: &Model<f64>, values: &Values) -> f64 {
        let data = Data {
            model: plain,
            ..self.data()
        };
        data.settled_refined(values).0.misfit
    }

    /// What `values`, all that was found, do here.
    pub(super) fn gap(&self, values: &Values, seed: u64) -> HeldOutGap {
        let data = Data {
            model: &self.bare,
            ..self.data()
        };
        let around = data.moved_to(values, &Wrong::nothing(), &[]);
        let model = with(&self.bare, values);
        let (misfit_expected, floor) = expected(self.track, &around, &model, seed);
        HeldOutGap {
            misfit_before: self.misfit_of(&self.bare, &Vec::new()),
            misfit_after: self.misfit_of(&self.bare, values),
            misfit_expected,
            gap: Gap::of(&data, values, &floor),
        }
    }
}
