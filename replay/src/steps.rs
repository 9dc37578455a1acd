//! A recording and the model side by side, step by step: a free run from the first frame, driven by the recorded
//! postures.

use std::collections::VecDeque;
use std::path::Path;

use bodyflight_core::Posture;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::observation::Observation;

use super::comparison::Pair;
use super::model_run::{ModelRun, PostureChange};
use super::motion_history::MotionHistory;
use super::recorded::Recorded;
use super::start::{SMOOTHED_OVER, first_motion};
use crate::Precision;
use crate::flight::{Flight, Start};
use crate::frames::Frames;
use crate::joint_change::{JointChange, changed};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{FlightFrame, Options, faults};

/// Longest sensor delay supported (s).
const LONGEST_DELAY: f64 = 1.0;

/// Largest component of a velocity with which the model can be stepped (m/s).
const LARGEST_SPEED: f64 = 1e4;

/// Components of velocity (m/s) and angular velocity (rad/s) that no falling body reaches: the fastest falls through thin
/// air were at 380 m/s, and the fastest spins of bodies in them at 20 rad/s.
const IMPLAUSIBLE_SPEED: f64 = 400.0;
const IMPLAUSIBLE_SPIN: f64 = 100.0;

/// One frame of a replay: the recording and the model's response.
#[derive(Debug, Clone, Copy)]
pub struct Step {
    /// Time since frame 0 (s).
    pub time: f64,
    /// Posture that the model flies: the recorded one, with the changes of joints if there are any.
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

/// The steps of a flight, from the second frame on. `F` is the source of the frames.
pub struct Replay<'a, F> {
    frames: F,
    /// Frames already read to smooth the start, not yet replayed.
    read: VecDeque<FlightFrame>,
    ahead: Option<FlightFrame>,
    side_by_side: SideBySide<'a>,
}

/// The model beside the recording; it does not depend on the source of the frames.
struct SideBySide<'a> {
    flight: &'a Flight,
    joints: &'a [JointChange],
    divergence: Divergence,
    /// When the model first moved as no body does (s), and how.
    diverged: Option<(f64, Motion<f64>)>,
    start: Step,
    last: Step,
    model: Model<f64>,
    run: ModelRun,
    history: MotionHistory,
}

impl<'a> Replay<'a, Frames> {
    /// Opens the recording of a flight.
    ///
    /// # Errors
    /// Returns an error if a file cannot be used, if there are fewer than two frames, or if the first frame has no
    /// velocity or angular velocity.
    pub fn open(flight: &'a Flight, options: Options, precision: Precision) -> Result<Self> {
        let frames = flight.open(options)?;
        Self::with_dynamics(flight, frames, precision, |height| flight.dynamics(height))
    }

    /// Like [`Replay::open`], with changes of joints, and with a given initial motion.
    ///
    /// # Errors
    /// Same as [`Replay::open`].
    pub fn open_changed(
        flight: &'a Flight,
        options: Options,
        precision: Precision,
        joints: &'a [JointChange],
        start: &Motion<f64>,
    ) -> Result<Self> {
        let mut frames = flight.open(options)?;
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = flight.dynamics(first[0].pelvis.position.up());
        let side_by_side =
            SideBySide::new(flight, precision, first, dynamics, joints, Some(start))?;
        Ok(Self::from(frames, read, side_by_side))
    }
}

impl Replay<'_, Frames> {
    /// The recording, with its header.
    pub fn recording(&self) -> &Frames {
        &self.frames
    }

    /// Why results so far cannot be trusted: faults of the recording, or a simulation that diverged.
    pub fn doubt(&self) -> Option<String> {
        faults(&self.frames.warnings()).or_else(|| self.diverged())
    }
}

impl<'a, F: Iterator<Item = Result<FlightFrame>>> Replay<'a, F> {
    /// Replays frames of a flight in double precision.
    ///
    /// # Errors
    /// Returns an error if there are fewer than two frames, or if the first frame has no velocity or angular velocity.
    pub fn new(flight: &'a Flight, frames: F) -> Result<Self> {
        let dynamics = |height| flight.dynamics(height);
        Self::with_dynamics(flight, frames, Precision::Double, dynamics)
    }

    /// Like [`Replay::new`], with other dynamics than the flight's, before effects are applied; `dynamics` is called
    /// with the height of the first frame (m, inertial).
    ///
    /// # Errors
    /// Same as [`Replay::new`].
    pub fn with_dynamics(
        flight: &'a Flight,
        mut frames: F,
        precision: Precision,
        dynamics: impl FnOnce(f64) -> Dynamics<f64>,
    ) -> Result<Self> {
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = dynamics(first[0].pelvis.position.up());
        let side_by_side = SideBySide::new(flight, precision, first, dynamics, &[], None)?;
        Ok(Self::from(frames, read, side_by_side))
    }

    /// Like [`Replay::new`], with changes of joints, and with a given initial motion.
    ///
    /// # Errors
    /// Same as [`Replay::new`].
    pub fn changed(
        flight: &'a Flight,
        mut frames: F,
        joints: &'a [JointChange],
        start: &Motion<f64>,
    ) -> Result<Self> {
        let mut read = first_frames(flight, &mut frames)?;
        let first = read.make_contiguous();
        let dynamics = flight.dynamics(first[0].pelvis.position.up());
        let precision = Precision::Double;
        let side_by_side =
            SideBySide::new(flight, precision, first, dynamics, joints, Some(start))?;
        Ok(Self::from(frames, read, side_by_side))
    }

    fn from(frames: F, mut read: VecDeque<FlightFrame>, side_by_side: SideBySide<'a>) -> Self {
        read.pop_front();
        let ahead = read.pop_front();
        Self {
            frames,
            read,
            ahead,
            side_by_side,
        }
    }

    /// Sets what happens if the simulation diverges.
    #[must_use]
    pub fn on_divergence(mut self, divergence: Divergence) -> Self {
        self.side_by_side.divergence = divergence;
        self
    }

    /// The first frame, with the initial motion of the model.
    pub const fn start(&self) -> &Step {
        &self.side_by_side.start
    }

    /// The model including its effects.
    pub const fn model(&self) -> &Model<f64> {
        &self.side_by_side.model
    }

    /// Why the simulation so far means nothing, if the model moved as no body does.
    pub fn diverged(&self) -> Option<String> {
        let (time, motion) = self.side_by_side.diverged?;
        let largest = |values: [f64; 3]| {
            let sizes = values.map(f64::abs);
            sizes.into_iter().fold(0.0, f64::max)
        };
        let (speed, spin) = (
            largest(motion.velocity.to_array()),
            largest(motion.angular_velocity.to_array()),
        );
        Some(format!(
            "the simulation diverges: at {time:.3} s the model moves at {speed:.0} m/s and turns at {spin:.0} rad/s, so that \
             nothing after that means anything"
        ))
    }

    /// The source of the frames.
    pub const fn frames(&self) -> &F {
        &self.frames
    }
}

impl<'a> SideBySide<'a> {
    /// Starts from the first two frames or more, with a given motion or that of the recording.
    fn new(
        flight: &'a Flight,
        precision: Precision,
        frames: &[FlightFrame],
        dynamics: Dynamics<f64>,
        joints: &'a [JointChange],
        start: Option<&Motion<f64>>,
    ) -> Result<Self> {
        let [first, second, ..] = frames else {
            return Err(too_short(&flight.recording));
        };
        let model = flight
            .effects
            .applied(dynamics, first.pelvis.position.up())?;
        let measured = motion_of(flight, first)?;
        let inputs = model.inputs(&flight.inputs_at(first.time));
        let recorded = Recorded::new(frames, model.dynamics, inputs)
            .map_err(|problem| problem.in_file(&flight.recording))?
            .under(&model.applied);
        let of_recording = || first_motion(flight.start, &recorded, 0, flight.equations);
        let simulated = start.copied().unwrap_or_else(of_recording);
        let posture = changed(joints, first.time, &first.posture);
        let start = Step {
            time: first.time,
            posture,
            measured,
            simulated,
            inputs,
            pair: Pair {
                time: first.time,
                measured: Observation::of(&measured),
                simulated: Observation::of(&simulated),
            },
        };
        let mut history = MotionHistory::default();
        history.push(first.time, &simulated, LONGEST_DELAY);
        let change = PostureChange {
            from: &posture,
            to: &changed(joints, second.time, &second.posture),
            duration: second.time - first.time,
        };
        let run = ModelRun::new(precision, &model, flight.equations, &simulated, change);
        Ok(Self {
            flight,
            joints,
            divergence: Divergence::default(),
            diverged: None,
            start,
            last: start,
            model,
            run,
            history,
        })
    }

    /// Advances to `frame`; if a frame follows, it is used for the joint rates at `frame`.
    fn advance(&mut self, frame: &FlightFrame, ahead: Option<&FlightFrame>) -> Result<Step> {
        let (before, duration) = (self.last.time, frame.time - self.last.time);
        let inputs = self.flight.inputs_at(before + 0.5 * duration);
        let inputs = self.model.inputs(&inputs);
        if let Some(history) = &self.flight.inputs {
            let muscles = history.muscles_at(before, &self.flight.muscles);
            self.run.set_muscles(muscles);
        }
        let since_start = before - self.start.time;
        let posture = changed(self.joints, frame.time, &frame.posture);
        self.run.advance(since_start, &inputs, &posture, duration);
        // Central difference if there are frames on both sides.
        let last = ahead.unwrap_or(frame);
        let simulated = self.run.motion(PostureChange {
            from: &self.last.posture,
            to: &changed(self.joints, last.time, &last.posture),
            duration: last.time - before,
        });
        let seen = self.seen(&simulated, frame.time)?;
        let measured = motion_of(self.flight, frame)?;
        Ok(Step {
            time: frame.time,
            posture,
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
        self.history.push(time, motion, LONGEST_DELAY);
        let past = |delay: f64| {
            let moving = self.history.at(time - delay);
            moving.unwrap_or_else(|| Moving::of(motion))
        };
        let sensors = &self.model.sensors;
        let seen = Observation::of(&sensors.observe(motion, past, time - self.start.time));
        let within = |values: [f64; 3], most: f64| values.iter().all(|value| value.abs() < most);
        let velocity = motion.velocity.to_array();
        let is_plausible = within(velocity, IMPLAUSIBLE_SPEED)
            && within(motion.angular_velocity.to_array(), IMPLAUSIBLE_SPIN);
        if !is_plausible {
            self.diverged.get_or_insert((time, *motion));
        }
        match self.divergence {
            _ if within(velocity, LARGEST_SPEED) => Ok(seen),
            Divergence::Held => Ok(self.last.pair.simulated),
            Divergence::Refused => Err(Problem::bad_input(format!(
                "the simulation diverges at {time:.3} s"
            ))
            .help(DIVERGED_HELP)),
        }
    }
}

impl<F: Iterator<Item = Result<FlightFrame>>> Iterator for Replay<'_, F> {
    type Item = Result<Step>;

    fn next(&mut self) -> Option<Self::Item> {
        let frame = self.ahead.take()?;
        let ahead = match self.read.pop_front() {
            Some(ahead) => Ok(Some(ahead)),
            None => self.frames.next().transpose(),
        };
        let step = ahead.and_then(|ahead| {
            self.ahead = ahead;
            self.side_by_side.advance(&frame, self.ahead.as_ref())
        });
        match step {
            Ok(step) => self.side_by_side.last = step,
            Err(_) => self.ahead = None,
        }
        Some(step)
    }
}

/// What to check after a divergence.
pub const DIVERGED_HELP: &str =
    "check the inputs, the damping coefficients and the segment table of the subject";

/// The first two frames, or as many as a smoothed start needs.
fn first_frames(
    flight: &Flight,
    frames: &mut impl Iterator<Item = Result<FlightFrame>>,
) -> Result<VecDeque<FlightFrame>> {
    let mut next = || {
        let frame = frames.next().transpose()?;
        frame.ok_or_else(|| too_short(&flight.recording))
    };
    let (first, second) = (next()?, next()?);
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
    Ok(read)
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
