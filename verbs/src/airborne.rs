//! `bodyflight airborne`: the parts of a recording in which nothing touches the body, and what its motion there says of
//! the capture.
//!
//! In the air the centre of mass falls with g and the angular momentum is constant, whatever the limbs do. [`phases`]
//! finds such parts, [`physics`] measures g and the angular momentum in each, and [`verdict`] says what is wrong if they
//! are not what they must be. The model predicts each phase as `validate` does.

pub mod figure;
pub mod phases;
pub mod physics;
mod steps;
pub mod verdict;

use std::path::Path;

use bodyflight_core::air::Density;
use bodyflight_core::dynamics::{Dynamics, State};
use bodyflight_core::frame::Vector;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{FlightFrame, Options};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::recorded::Recorded;
use nalgebra::{UnitQuaternion, Vector3};
use schemars::JsonSchema;
use serde::Serialize;

use crate::validate::windows::{self, Row, predicted};
use physics::{Fall, Momentum};
use verdict::Verdict;

/// Lengths over which the attitude is predicted (s), besides the whole phase.
pub const LENGTHS: [f64; 3] = [0.1, 0.25, 0.5];
/// Difference of time within which a phase has a length (s).
const SLACK: f64 = 2e-3;

/// The result for one recording.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Report {
    /// The parts in the air.
    pub phases: Vec<Phase>,
    /// What they say of the capture.
    pub verdict: Verdict,
    /// Frames per second (Hz).
    pub frame_rate_hz: f64,
    /// Whether a subject was given; otherwise the mass distribution is that of a default person.
    pub has_subject: bool,
}

/// A part in which nothing touches the body.
#[derive(Debug, Clone, JsonSchema, Serialize)]
pub struct Phase {
    /// Its begin (s since frame 0).
    pub begin_s: f64,
    /// Its length (s).
    pub length_s: f64,
    /// The fall of the centre of mass.
    pub fall: Fall,
    /// The angular momentum about the centre of mass.
    pub momentum: Momentum,
    /// Errors of the predicted attitude, by model and length; the last length is the whole phase.
    pub predictions: Vec<Row>,
}

/// A recording in memory, with the motion of its centre of mass.
pub struct Capture {
    frames: Vec<FlightFrame>,
    recorded: Recorded,
    states: Vec<State<f64>>,
    rate: f64,
    has_subject: bool,
}

impl Capture {
    /// Reads a recording or a flight. Velocities that it lacks are differences of positions and attitudes.
    ///
    /// # Errors
    /// Returns an error if a file is unusable or has fewer than three frames.
    pub fn read(path: &Path) -> Result<Self> {
        let flight = Flight::read(path)?;
        let recording = flight.open(Options::default())?;
        let rate = recording.header().frame_rate;
        let mut frames = recording.collect::<Result<Vec<_>>>()?;
        if frames.len() < 3 {
            return Err(Problem::bad_input("expected at least three frames").in_file(path));
        }
        fill_rates(&mut frames);
        let mut dynamics = flight.dynamics(0.0);
        // The air does nothing in a jump, and is far below the noise in a short one from a tower.
        dynamics.air.density = Density::Constant(0.0);
        let recorded = Recorded::new(&frames, dynamics, flight.constant_inputs())?;
        let states = states(&recorded);
        Ok(Self {
            frames,
            recorded,
            states,
            rate,
            has_subject: flight.has_subject,
        })
    }

    /// Time of each frame (s).
    pub fn times(&self) -> Vec<f64> {
        let samples = self.recorded.samples.iter();
        samples.map(|sample| sample.time).collect()
    }

    /// Position of the centre of mass in each frame (m).
    pub fn centres(&self) -> Vec<Vector3<f64>> {
        self.states
            .iter()
            .map(|state| state.cg_position.components)
            .collect()
    }

    fn momenta(&self, [first, last]: [usize; 2]) -> Vec<Vector3<f64>> {
        let part = &self.states[first..=last];
        part.iter()
            .map(|state| state.angular_momentum.components)
            .collect()
    }

    fn dynamics(&self) -> &Dynamics<f64> {
        &self.recorded.dynamics
    }
}

/// Position, momentum and angular momentum of the whole body in each frame.
fn states(recorded: &Recorded) -> Vec<State<f64>> {
    let frames = 0..recorded.samples.len();
    frames
        .map(|frame| {
            let rate = recorded.rate(frame);
            let sample = recorded
                .dynamics
                .sample(&recorded.samples[frame].posture, &rate);
            State::from_motion(&recorded.samples[frame].motion, &sample)
        })
        .collect()
}

/// Fills in velocities and angular velocities that the file lacks: central differences.
fn fill_rates(frames: &mut [FlightFrame]) {
    let places: Vec<(f64, Vector3<f64>, UnitQuaternion<f64>)> = (frames.iter())
        .map(|frame| {
            let pelvis = &frame.pelvis;
            let attitude = *pelvis.inertial_from_body.quaternion();
            (frame.time, pelvis.position.components, attitude)
        })
        .collect();
    for (k, frame) in frames.iter_mut().enumerate() {
        let (before, from, attitude) = &places[k.saturating_sub(1)];
        let (after, to, next) = &places[(k + 1).min(places.len() - 1)];
        let duration = after - before;
        let turn: UnitQuaternion<f64> = next * attitude.inverse();
        let pelvis = &mut frame.pelvis;
        let velocity = Vector::from_components((to - from) / duration);
        pelvis.velocity.get_or_insert(velocity);
        let spin = Vector::from_components(turn.scaled_axis() / duration);
        pelvis.angular_velocity.get_or_insert(spin);
    }
}

/// A part in which nothing touches the body, with its frames.
pub struct Part {
    /// Its begin (s since frame 0).
    pub begin_s: f64,
    /// Its length (s).
    pub length_s: f64,
    /// The fall of the centre of mass.
    pub fall: Fall,
    /// The angular momentum about the centre of mass.
    pub momentum: Momentum,
    /// Its frames.
    pub recorded: Recorded,
}

/// Finds the parts of a recording in which nothing touches the body.
///
/// # Errors
/// Returns an error if a frame has no velocity.
pub fn parts(capture: &Capture) -> Result<Vec<Part>> {
    let centres = capture.centres();
    let mut parts = Vec::new();
    let times = capture.times();
    for [first, last] in phases::found(&times, &centres) {
        let times = &times[first..=last];
        let Some(fall) = physics::fall(times, &centres[first..=last]) else {
            continue;
        };
        let frames = &capture.frames[first..=last];
        parts.push(Part {
            begin_s: times[0],
            length_s: times[times.len() - 1] - times[0],
            fall,
            momentum: physics::momentum(times, &capture.momenta([first, last])),
            recorded: Recorded::new(frames, *capture.dynamics(), capture.recorded.inputs)?,
        });
    }
    Ok(parts)
}

/// Finds and judges the phases of a recording.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn airborne(capture: &Capture) -> Result<Report> {
    let parts = parts(capture)?;
    let verdict = judged(capture, &parts);
    let mut phases = Vec::new();
    for part in parts {
        let length = part.length_s;
        let mut predictions = Vec::new();
        for window in LENGTHS
            .into_iter()
            .filter(|window| *window < length - SLACK)
            .chain([length])
        {
            for model in windows::MODELS {
                predictions.extend(predicted(&[&part.recorded], window, model)?);
            }
        }
        phases.push(Phase {
            begin_s: part.begin_s,
            length_s: length,
            fall: part.fall,
            momentum: part.momentum,
            predictions,
        });
    }
    Ok(Report {
        verdict,
        phases,
        frame_rate_hz: capture.rate,
        has_subject: capture.has_subject,
    })
}

/// What the parts of a capture in the air say of it.
pub fn judged(capture: &Capture, parts: &[Part]) -> Verdict {
    let falls: Vec<Fall> = parts.iter().map(|part| part.fall).collect();
    let momenta: Vec<Momentum> = parts.iter().map(|part| part.momentum).collect();
    let steps = steps::found(&capture.frames);
    Verdict::of(&falls, &momenta, steps, capture.rate)
}
