//! A recorded flight held in memory, and runs of the model over parts of it.
//!
//! Validation starts the model at many frames of one flight, and the smoothed start runs it several times over the
//! first tenth of a second. Both need random access to frames, which reading a long flight frame by frame does not
//! offer.

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::{MassMotion, PostureRate};
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use nalgebra::Vector3;

use crate::diagnostic::Result;
use crate::formats::recording::FlightFrame;

/// Which parts of the model a run includes, for comparison with the complete model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Variant {
    /// The complete equations, in either form.
    Whole(Equations),
    /// Exact, except that moving limbs carry no momentum of their own.
    WithoutLimbMomentum,
    /// Exact, except that the posture of the first frame is kept.
    FrozenPosture,
}

/// Frames of a flight together with the model that flies it.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// Time of each frame (s).
    pub times: Vec<f64>,
    /// Recorded postures.
    pub postures: Vec<Posture<f64>>,
    /// Recorded motion of the pelvis.
    pub measured: Vec<Motion<f64>>,
    /// The model.
    pub dynamics: Dynamics<f64>,
    /// Conscious inputs, constant over the flight.
    pub inputs: Inputs<f64>,
    /// Additional applied loads, timed from the first frame.
    pub applied: AppliedLoads<f64>,
}

impl Recorded {
    /// Builds a recorded flight from frames.
    ///
    /// # Errors
    /// Returns an error if a frame has no velocity or angular velocity.
    pub fn new(
        frames: &[FlightFrame],
        dynamics: Dynamics<f64>,
        inputs: Inputs<f64>,
    ) -> Result<Self> {
        Ok(Self {
            times: frames.iter().map(|frame| frame.time).collect(),
            postures: frames.iter().map(|frame| frame.posture).collect(),
            measured: frames
                .iter()
                .map(FlightFrame::motion)
                .collect::<Result<_>>()?,
            dynamics,
            inputs,
            applied: AppliedLoads::none(),
        })
    }

    /// The same flight with additional applied loads.
    #[must_use]
    pub fn under(self, applied: &AppliedLoads<f64>) -> Self {
        Self {
            applied: *applied,
            ..self
        }
    }

    /// Joint rates at a frame: central differences if it has frames on both sides.
    fn rate(&self, frame: usize) -> PostureRate<f64> {
        let before = frame.saturating_sub(1);
        let after = (frame + 1).min(self.times.len() - 1);
        PostureRate::between(
            &self.postures[before],
            &self.postures[after],
            self.times[after] - self.times[before],
        )
    }

    /// Motion at each frame from `first` to `last`, in a run that starts at `first` with the motion `start`.
    pub fn run(
        &self,
        first: usize,
        last: usize,
        start: &Motion<f64>,
        variant: Variant,
    ) -> Vec<Motion<f64>> {
        match variant {
            Variant::Whole(equations) => self.free_run(first, last, start, equations, false),
            Variant::FrozenPosture => self.free_run(first, last, start, Equations::Exact, true),
            Variant::WithoutLimbMomentum => self.run_without_limb_momentum(first, last, start),
        }
    }

    fn free_run(
        &self,
        first: usize,
        last: usize,
        start: &Motion<f64>,
        equations: Equations,
        frozen: bool,
    ) -> Vec<Motion<f64>> {
        let posture = |frame: usize| &self.postures[if frozen { first } else { frame }];
        let rate = |frame: usize| {
            if frozen {
                PostureRate::zero()
            } else {
                self.rate(frame)
            }
        };
        let mut run = FreeRun::new(
            &self.dynamics,
            equations,
            start,
            posture(first),
            &rate(first),
        );
        let mut motions = vec![*start];
        for frame in first + 1..=last {
            let duration = self.times[frame] - self.times[frame - 1];
            let since_start = self.times[frame - 1] - self.times[0];
            run.advance_under(
                (&self.applied, since_start),
                &self.dynamics,
                &self.inputs,
                posture(frame),
                duration,
            );
            motions.push(run.motion(&self.dynamics, &rate(frame)));
        }
        motions
    }

    /// The posture changes, and the inertia with it, but the motion of the limbs carries no momentum.
    fn run_without_limb_momentum(
        &self,
        first: usize,
        last: usize,
        start: &Motion<f64>,
    ) -> Vec<Motion<f64>> {
        let mut state = State::from_motion(start, &self.dynamics.hold(&self.postures[first]));
        let mut motions = vec![*start];
        for frame in first + 1..=last {
            let duration = self.times[frame] - self.times[frame - 1];
            let (from, to) = (&self.postures[frame - 1], &self.postures[frame]);
            let mut sample = self.dynamics.between(from, to, duration);
            sample.motion = MassMotion::zero();
            sample.relative_angular_momentum = Vector3::zeros();
            state = self.dynamics.step(&state, &sample, &self.inputs, duration);
            motions.push(state.motion(&self.dynamics.hold(to)));
        }
        motions
    }

    /// The last frame no later than `time` (s) after frame `first`.
    pub fn frame_at(&self, first: usize, time: f64) -> usize {
        let end = self.times[first] + time + 1e-6;
        self.times
            .partition_point(|moment| *moment <= end)
            .saturating_sub(1)
            .max(first)
    }
}
