//! A recording and the model side by side, step by step: a free run from the first frame, driven by the recorded
//! postures.

use std::collections::VecDeque;
use std::path::Path;

use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::free_run::FreeRun;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::observation::Observation;
use bodyflight_core::{Posture, Real};
use bodyflight_discovery::motion_history::MotionHistory;

use super::comparison::Pair;
use super::recorded::Recorded;
use super::start::{SMOOTHED_OVER, first_motion};
use crate::diagnostic::{Problem, Result};
use crate::formats::flight::{Flight, Start};
use crate::formats::input::Input;
use crate::formats::recording::{FlightFrame, Options, Recording};

/// Longest sensor delay supported (s).
const LONGEST_DELAY: f64 = 1.0;

/// Largest component of a velocity that is plausible (m/s).
const PLAUSIBLE_SPEED: f64 = 1e4;

/// One frame of a replay: the recording and the model's response.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Time since frame 0 (s).
    pub time: f64,
    /// Recorded posture.
    pub posture: Posture<f64>,
    /// Recorded motion of the pelvis.
    pub measured: Motion<f64>,
    /// Motion of the model, before its sensors.
    pub simulated: Motion<f64>,
    /// Conscious inputs up to this frame.
    pub inputs: Inputs<f64>,
    /// The compared pair: the recorded motion, and the model's motion as seen by its sensors.
    pub pair: Pair,
}

/// What a replay does if the simulation diverges.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Divergence {
    /// Stops with an error.
    #[default]
    Refused,
    /// Continues, comparing with the last plausible motion.
    Held,
}

/// The steps of a flight, from the second frame on.
///
/// `T` is the precision of the model, `F` the source of the frames.
pub struct Replay<'a, T: Real, F> {
    flight: &'a Flight,
    frames: F,
    divergence: Divergence,
    /// Frames already read to smooth the start, not yet replayed.
    read: VecDeque<FlightFrame>,
    ahead: Option<FlightFrame>,
    start: Step,
    last: Step,
    model: Model<f64>,
    dynamics: Dynamics<T>,
    applied: AppliedLoads<T>,
    run: FreeRun<T>,
    history: MotionHistory,
}

impl<'a, T: Real> Replay<'a, T, Recording<Input>> {
    /// Opens the recording of a flight.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, if there are fewer than two frames, or if the first frame has no
    /// velocity or angular velocity.
    pub fn open(flight: &'a Flight, options: Options) -> Result<Self> {
        Self::new(flight, flight.open(options)?)
    }
}

impl<'a, T: Real, F: Iterator<Item = Result<FlightFrame>>> Replay<'a, T, F> {
    /// Replays frames of a flight.
    ///
    /// # Errors
    /// Returns an error if there are fewer than two frames, or if the first frame has no velocity or angular velocity.
    pub fn new(flight: &'a Flight, frames: F) -> Result<Self> {
        Self::with_dynamics(flight, frames, |height| flight.dynamics(height))
    }

    /// Like [`Replay::new`], with other dynamics than the flight's, before effects are applied; `dynamics` is called
    /// with the height of the first frame (m, inertial).
    ///
    /// # Errors
    /// Same as [`Replay::new`].
    pub fn with_dynamics(
        flight: &'a Flight,
        mut frames: F,
        dynamics: impl FnOnce(f64) -> Dynamics<f64>,
    ) -> Result<Self> {
        let mut next = || {
            let frame = frames.next().transpose()?;
            frame.ok_or_else(|| too_short(&flight.recording))
        };
        let (first, second) = (next()?, next()?);
        let height = first.pelvis.position.up();
        let model = flight.effects.applied(dynamics(height), height)?;
        let measured = motion_of(flight, &first)?;
        let mut read = VecDeque::from([first, second]);
        if flight.start == Start::Smoothed {
            let is_enough = |last: &FlightFrame| last.time - first.time >= SMOOTHED_OVER - 1e-6;
            while !read.back().is_some_and(is_enough) {
                let Some(frame) = frames.next().transpose()? else {
                    break;
                };
                read.push_back(frame);
            }
        }
        let inputs = model.inputs(&flight.inputs_at(first.time));
        let recorded = Recorded::new(read.make_contiguous(), model.dynamics, inputs)
            .map_err(|problem| problem.in_file(&flight.recording))?
            .under(&model.applied);
        let simulated = first_motion(flight.start, &recorded, 0, flight.equations);
        read.drain(..2);
        let seen = Observation::of(&measured);
        let start = Step {
            time: first.time,
            posture: first.posture,
            measured,
            simulated,
            inputs,
            pair: Pair {
                time: first.time,
                measured: seen,
                simulated: Observation::of(&simulated),
            },
        };
        let mut history = MotionHistory::default();
        history.push(first.time, Moving::of(&simulated));
        let dynamics = model.dynamics.cast::<T>();
        let rate = rate(&first.posture, &second.posture, second.time - first.time);
        let posture = first.posture.cast();
        let run = FreeRun::new(
            &dynamics,
            flight.equations,
            &simulated.cast(),
            &posture,
            &rate,
        );
        Ok(Self {
            flight,
            frames,
            divergence: Divergence::default(),
            read,
            ahead: Some(second),
            start,
            last: start,
            applied: model.applied.cast(),
            model,
            dynamics,
            run,
            history,
        })
    }

    /// Sets what happens if the simulation diverges.
    #[must_use]
    pub fn on_divergence(self, divergence: Divergence) -> Self {
        Self { divergence, ..self }
    }

    /// The first frame, with the initial motion of the model.
    pub const fn start(&self) -> &Step {
        &self.start
    }

    /// The model including its effects.
    pub const fn model(&self) -> &Model<f64> {
        &self.model
    }

    /// The source of the frames.
    pub const fn frames(&self) -> &F {
        &self.frames
    }

    /// Advances to `frame`; if a frame follows, it is used for the joint rates at `frame`.
    fn advance(&mut self, frame: &FlightFrame) -> Result<Step> {
        let (before, duration) = (self.last.time, frame.time - self.last.time);
        let inputs = self.flight.inputs_at(before + 0.5 * duration);
        let inputs = self.model.inputs(&inputs);
        if let Some(history) = &self.flight.inputs {
            self.dynamics.muscles = history.muscles_at(before, &self.flight.muscles);
        }
        let since_start = T::of(before - self.start.time);
        self.run.advance_under(
            (&self.applied, since_start),
            &self.dynamics,
            &inputs.cast(),
            &frame.posture.cast(),
            T::of(duration),
        );
        // Central difference if there are frames on both sides.
        let last = self.ahead.as_ref().unwrap_or(frame);
        let rate = rate(&self.last.posture, &last.posture, last.time - before);
        let simulated = self.run.motion(&self.dynamics, &rate).cast::<f64>();
        let seen = self.seen(&simulated, frame.time)?;
        let measured = motion_of(self.flight, frame)?;
        Ok(Step {
            time: frame.time,
            posture: frame.posture,
            measured,
            simulated,
            inputs,
            pair: Pair {
                time: frame.time,
                measured: Observation::of(&measured),
                simulated: seen,
            },
        })
    }

    /// The motion as seen by the model's sensors.
    fn seen(&mut self, motion: &Motion<f64>, time: f64) -> Result<Observation<f64>> {
        self.history.push_within(time, motion, LONGEST_DELAY);
        let past = |delay: f64| {
            let moving = self.history.at(time - delay);
            moving.unwrap_or_else(|| Moving::of(motion))
        };
        let sensors = &self.model.sensors;
        let seen = Observation::of(&sensors.observe(motion, past, time - self.start.time));
        let is_plausible = |v: &f64| v.abs() < PLAUSIBLE_SPEED;
        match self.divergence {
            _ if motion.velocity.to_array().iter().all(is_plausible) => Ok(seen),
            Divergence::Held => Ok(self.last.pair.simulated),
            Divergence::Refused => Err(Problem::bad_input(format!(
                "the simulation diverges at {time:.3} s"
            ))
            .help("check the damping coefficients and the segment table of the subject")),
        }
    }
}

impl<T: Real, F: Iterator<Item = Result<FlightFrame>>> Iterator for Replay<'_, T, F> {
    type Item = Result<Step>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.ahead.take()?;
        let ahead = match self.read.pop_front() {
            Some(ahead) => Ok(Some(ahead)),
            None => self.frames.next().transpose(),
        };
        let step = ahead.and_then(|ahead| {
            self.ahead = ahead;
            self.advance(&frame)
        });
        match step {
            Ok(step) => self.last = step,
            Err(_) => self.ahead = None,
        }
        Some(step)
    }
}

/// The error for a recording with fewer than two frames.
pub fn too_short(recording: &Path) -> Problem {
    Problem::bad_input("expected at least two frames of type \"normal\"").in_file(recording)
}

fn motion_of(flight: &Flight, frame: &FlightFrame) -> Result<Motion<f64>> {
    frame
        .motion()
        .map_err(|problem| problem.in_file(&flight.recording))
}

/// Joint rates from one posture to another, `duration` (s) later.
fn rate<T: Real>(from: &Posture<f64>, to: &Posture<f64>, duration: f64) -> PostureRate<T> {
    PostureRate::between(&from.cast(), &to.cast(), T::of(duration))
}
