//! A flight at the rate of its recording, and the model with which the page simulates it again with changes.

use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::dynamics::free_run::Equations;
use bodyflight_core::effect::Model;
use bodyflight_core::{Posture, Segment};
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::steps::Step;
use bodyflight_viewer::setup::Setup;
use bodyflight_viewer::what_if::start_numbers;
use nalgebra::UnitQuaternion;
use serde::Serialize;

use super::series::{Packed, Series};

/// The columns, with the count of numbers in a row and their step. Inputs are those up to a row; postures are
/// `parent_from_segment` of all segments but the pelvis.
const COLUMNS: [(&str, usize, f64); 5] = [
    ("time_s", 1, 1e-6),
    ("measured", 7, 1e-4),
    ("simulated", 7, 1e-4),
    ("inputs", 6, 1e-6),
    ("postures", 4 * (SEGMENT_COUNT - 1), 2e-5),
];

/// The model of a flight, as numbers.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ModelNumbers {
    /// The model, see [`bodyflight_viewer::setup`].
    pub setup: Vec<f64>,
    /// The initial motion, see [`bodyflight_viewer::what_if::START`].
    pub start: Vec<f64>,
    /// Whether the equations are those that the paper prints.
    pub as_published: bool,
    /// Mass of the person with all equipment (kg).
    pub mass_kg: f64,
}

/// A flight at the rate of its recording.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct FullRate {
    /// Channels, inputs and postures.
    pub series: Packed,
    /// The model, if the page can simulate with it.
    pub model: Option<ModelNumbers>,
    /// Why it cannot.
    pub no_model: Option<String>,
}

/// A flight being collected.
pub(super) struct Collected {
    series: Series,
    model: Result<ModelNumbers, &'static str>,
    last: Posture<f64>,
}

impl Collected {
    /// Starts with the first frame of a flight.
    pub(super) fn new(flight: &Flight, model: &Model<f64>, start: &Step) -> Self {
        let mut collected = Self {
            series: Series::new(&COLUMNS),
            model: numbers(flight, model, start),
            last: start.posture,
        };
        collected.push(flight, start);
        collected
    }

    pub(super) fn push(&mut self, flight: &Flight, step: &Step) {
        let seen = [&step.pair.measured, &step.pair.simulated];
        let channels = seen
            .into_iter()
            .flat_map(|seen| Channel::ALL.map(|own| own.value(seen)));
        let inputs = step.inputs.muscle.to_array().into_iter();
        let inputs = inputs.chain(step.inputs.damping.to_array());
        let postures = Segment::ALL.into_iter().skip(1).flat_map(|segment| {
            let turn = step.posture.parent_from_segment(segment);
            // Of both quaternions of a rotation the one near the row before, which packs better.
            near(turn, self.last.parent_from_segment(segment))
        });
        let row = std::iter::once(step.time).chain(channels).chain(inputs);
        self.series.push(row.chain(postures).collect::<Vec<f64>>());
        for segment in Segment::ALL.into_iter().skip(1) {
            let turn = step.posture.parent_from_segment(segment);
            let [w, x, y, z] = near(turn, self.last.parent_from_segment(segment));
            let same = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z));
            self.last.set(segment, same);
        }
        if let Some(history) = &flight.inputs {
            let is_residual =
                step.inputs.residual != bodyflight_core::dynamics::Inputs::belly_turn().residual;
            if is_residual {
                self.model = Err("its inputs contain loads that nothing in the model explains");
            } else if history.muscles_at(step.time, &flight.muscles) != flight.muscles {
                self.model = Err("its inputs name their own limb groups");
            }
        }
    }

    pub(super) fn finished(self) -> FullRate {
        let (model, no_model) = match self.model {
            Ok(model) => (Some(model), None),
            Err(why) => (None, Some(why.to_owned())),
        };
        FullRate {
            series: self.series.packed(),
            model,
            no_model,
        }
    }
}

/// Components (w, x, y, z) of that of both quaternions of a rotation which is nearer to another one.
fn near(turn: &UnitQuaternion<f64>, other: &UnitQuaternion<f64>) -> [f64; 4] {
    let sign = turn.coords.dot(&other.coords).signum();
    [turn.w, turn.i, turn.j, turn.k].map(|part| sign * part)
}

/// The model as numbers, or why they cannot represent it.
fn numbers(
    flight: &Flight,
    model: &Model<f64>,
    start: &Step,
) -> Result<ModelNumbers, &'static str> {
    if *model != Model::new(model.dynamics, model.start_height) || !flight.effects.named.is_empty()
    {
        return Err("effects act on it");
    }
    let setup = Setup {
        dynamics: model.dynamics,
        inputs: flight.constant_inputs(),
    };
    let numbers = setup.numbers();
    if Setup::from_numbers(&numbers) != setup {
        return Err("its model has parts that the page does not simulate");
    }
    Ok(ModelNumbers {
        setup: numbers.to_vec(),
        start: start_numbers(&start.simulated).to_vec(),
        as_published: flight.equations == Equations::AsPublished,
        mass_kg: model.dynamics.body.mass(),
    })
}
