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

use super::series::{Packed, Recorded};

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
    series: Recorded,
    model: Result<ModelNumbers, &'static str>,
    last: Posture<f64>,
}

impl Collected {
    /// Starts with the first frame of a flight.
    pub(super) fn new(flight: &Flight, model: &Model<f64>, start: &Step) -> Self {
        let mut collected = Self {
            series: Recorded::new(&COLUMNS),
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

#[cfg(test)]
mod tests {
    use std::path::Path;

    use bodyflight_core::body::joint_angle::JointAngle;
    use bodyflight_core::dynamics::Motion;
    use bodyflight_core::maneuver::Maneuver;
    use bodyflight_laboratory::synthesize::{Request, synthesize};
    use bodyflight_mvnx::recording::Options;
    use bodyflight_replay::Precision;
    use bodyflight_replay::joint_change::JointChange;
    use bodyflight_replay::model_file::Effects;
    use bodyflight_replay::steps::Replay;
    use bodyflight_replay::subject::Subject;
    use bodyflight_viewer::what_if::{Change as PageChange, Changes, Row, WhatIf, motion};

    use super::*;
    use crate::simulate::what_if::{Change, what_if};

    /// A flight with known inputs that change.
    fn roll(folder: &Path) -> Flight {
        let subject = Subject::default();
        let request = Request {
            sway: 0.0,
            ..Request::new(Maneuver::from_name("barrel-roll").unwrap(), &subject, 1)
        };
        let flown = synthesize(&request, folder, &mut |_| {}).unwrap();
        Flight::read(&flown.flight).unwrap()
    }

    /// The motions of a flight with changes, as the page steps it.
    fn in_the_page(flight: &Flight, changes: &Changes) -> Vec<Motion<f64>> {
        let mut replay = Replay::open(flight, Options::default(), Precision::Double).unwrap();
        let start = *replay.start();
        let model = numbers(flight, replay.model(), &start).unwrap();
        let setup = Setup::from_numbers(&model.setup.try_into().unwrap());
        let begin = motion(&model.start.try_into().unwrap());
        let mut run = WhatIf::new(&setup, flight.equations, begin, changes);
        let row = |step: &Step| Row {
            time: step.time,
            inputs: step.inputs,
            posture: step.posture,
        };
        run.push(&row(&start));
        let mut motions = Vec::new();
        for step in replay.by_ref() {
            if run.push(&row(&step.unwrap())) {
                motions.push(*run.motion());
            }
        }
        run.finish();
        motions.push(*run.motion());
        motions
    }

    /// The motions that `simulate` gives, from the first row on.
    fn in_the_program(flight: &Flight, joints: &[&str], without_inputs: bool) -> Vec<Motion<f64>> {
        let parse = |text: &&str| JointChange::parse(text).unwrap();
        let change = Change {
            joints: joints.iter().map(parse).collect(),
            subject: None,
            without_inputs,
        };
        let start = *Replay::open(flight, Options::default(), Precision::Double)
            .unwrap()
            .start();
        let mut motions = vec![start.simulated];
        let mut each = |steps: [&Step; 2]| {
            motions.push(steps[1].simulated);
            Ok(())
        };
        let (options, precision) = (Options::default(), Precision::Double);
        what_if(flight, &change, options, precision, &mut each, &mut |_| {}).unwrap();
        motions
    }

    /// The largest difference of velocities (m/s) or angular velocities (rad/s).
    fn apart(page: &[Motion<f64>], program: &[Motion<f64>]) -> f64 {
        assert_eq!(page.len(), program.len());
        let pairs = page.iter().zip(program);
        let apart = |(a, b): (&Motion<f64>, &Motion<f64>)| {
            let spin = (a.angular_velocity - b.angular_velocity).norm();
            spin.max((a.velocity - b.velocity).norm())
        };
        pairs.map(apart).fold(0.0, f64::max)
    }

    fn of_page(name: &str, degrees: f64, window: Option<[f64; 2]>) -> PageChange {
        PageChange {
            angle: JointAngle::all()
                .find(|angle| angle.to_string() == name)
                .unwrap(),
            by: degrees.to_radians(),
            window,
        }
    }

    #[test]
    fn changes_in_the_page_are_those_of_the_program() {
        let folder = tempfile::tempdir().unwrap();
        let flight = roll(folder.path());
        let mut joints = Changes::default();
        joints.add(of_page("l_shank.bend", 20.0, None));
        joints.add(of_page("r_upperarm.phi", -15.0, Some([0.5, 1.2])));
        let words = ["l_shank.bend=+20", "r_upperarm.phi=-15@0.5..1.2"];
        let program = in_the_program(&flight, &words, false);
        assert!(apart(&in_the_page(&flight, &joints), &program) < 1e-9);

        let relaxed = Changes::of_body(1.0, 1.0, true);
        let program = in_the_program(&flight, &[], true);
        assert!(apart(&in_the_page(&flight, &relaxed), &program) < 1e-9);
        assert!(apart(&in_the_page(&flight, &Changes::default()), &program) > 0.1);

        let factors = |name: &str| {
            format!(
                "[[effect]]\nname = \"{name}\"\ntrunk_factor = 0.9\narms_factor = 0.9\nlegs_factor = 0.9\n"
            )
        };
        let text = ["[[effect]]\nname = \"mass\"\nfactor = 1.2\n".to_owned()]
            .into_iter()
            .chain(["drag", "lift", "moment"].map(factors))
            .collect::<String>();
        let mut other = flight.clone();
        other.effects = Effects::parse(&text, Path::new("model.toml")).unwrap();
        // From the start of the plain flight: an effect may change the fit to its first frames.
        let (options, precision) = (Options::default(), Precision::Double);
        let plain = Replay::open(&flight, options, precision).unwrap();
        let start = plain.start().simulated;
        let program = Replay::open_changed(&other, options, precision, &[], &start).unwrap();
        let steps = program.map(|step| step.unwrap().simulated);
        let program: Vec<Motion<f64>> = std::iter::once(start).chain(steps).collect();
        let page = in_the_page(&flight, &Changes::of_body(1.2, 0.9, false));
        assert!(apart(&page, &program) < 1e-9, "{}", apart(&page, &program));
    }

    #[test]
    fn a_model_that_numbers_cannot_represent_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mut flight = roll(folder.path());
        flight.effects = Effects::parse(
            "[[effect]]\nname = \"wind\"\nnorth_mps = 4\n",
            Path::new("model.toml"),
        )
        .unwrap();
        let replay = Replay::open(&flight, Options::default(), Precision::Double).unwrap();
        let mut collected = Collected::new(&flight, replay.model(), replay.start());
        for step in replay {
            collected.push(&flight, &step.unwrap());
        }
        let full = collected.finished();
        assert_eq!(full.model, None);
        assert_eq!(full.no_model.as_deref(), Some("effects act on it"));
        assert!(full.series.rows > 240);
    }
}
