//! The model beside a recording, frame by frame.

use std::path::Path;

use bodyflight_core::Posture;
use bodyflight_core::dynamics::muscle_input::MuscleModel;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::observation::Observation;

use super::comparison::Pair;
use super::model_run::{ModelRun, PostureChange};
use super::motion_history::MotionHistory;
use super::recorded::Recorded;
use super::start::first_motion;
use crate::Precision;
use crate::flight::Flight;
use crate::joint_change::{JointChange, changed};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::FlightFrame;

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

/// What to check after a divergence.
pub const DIVERGED_HELP: &str =
    "check the inputs, the damping coefficients and the segment table of the subject";

/// The model beside the recording; it does not depend on the source of the frames.
pub(crate) struct SideBySide<'a> {
    pub(crate) flight: &'a Flight,
    joints: &'a [JointChange],
    pub(crate) divergence: Divergence,
    /// When the model first moved as no body does (s), and how.
    diverged: Option<(f64, Motion<f64>)>,
    pub(crate) start: Step,
    pub(crate) last: Step,
    pub(crate) model: Model<f64>,
    pub(crate) run: ModelRun,
    history: MotionHistory,
}

impl<'a> SideBySide<'a> {
    /// Starts from the first two frames or more, with a given motion or that of the recording.
    pub(crate) fn new(
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
    pub(crate) fn advance(
        &mut self,
        frame: &FlightFrame,
        ahead: Option<&FlightFrame>,
    ) -> Result<Step> {
        let (before, duration) = (self.last.time, frame.time - self.last.time);
        let inputs = self.inputs(before + 0.5 * duration);
        if let Some(muscles) = self.muscles(before) {
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

    /// Conscious inputs at `time` (s), with those of effects.
    pub(crate) fn inputs(&self, time: f64) -> Inputs<f64> {
        self.model.inputs(&self.flight.inputs_at(time))
    }

    /// The limbs that muscle input acts on from `time` (s) on, if inputs over time name them.
    pub(crate) fn muscles(&self, time: f64) -> Option<MuscleModel> {
        let history = self.flight.inputs.as_ref()?;
        Some(history.muscles_at(time, &self.flight.muscles))
    }

    /// Why the simulation so far means nothing, if the model moved as no body does.
    pub(crate) fn diverged(&self) -> Option<String> {
        let (time, motion) = self.diverged?;
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

    /// The motion as seen by the model's sensors.
    pub(crate) fn seen(&mut self, motion: &Motion<f64>, time: f64) -> Result<Observation<f64>> {
        let sensors = &self.model.sensors;
        if sensors.velocity_latency != 0.0 || sensors.rate_lag != 0.0 {
            self.history.push(time, motion, LONGEST_DELAY);
        }
        let past = |delay: f64| {
            let moving = self.history.at(time - delay);
            moving.unwrap_or_else(|| Moving::of(motion))
        };
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

pub(crate) fn motion_of(flight: &Flight, frame: &FlightFrame) -> Result<Motion<f64>> {
    frame
        .motion()
        .map_err(|problem| problem.in_file(&flight.recording))
}

/// The error for a recording with fewer than two frames.
pub fn too_short(recording: &Path) -> Problem {
    Problem::bad_input("expected at least two frames of type \"normal\"").in_file(recording)
}
