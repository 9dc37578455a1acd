//! A recorded flight held in memory, and runs of the model over parts of it.
//!
//! Validation starts the model at many frames of one flight, and the smoothed start runs it several times over the
//! first tenth of a second. Both need random access to frames, which reading a long flight frame by frame does not
//! offer.

use bodyflight_core::body::mass_properties::{MassMotion, PostureRate};
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::free_run::{Equations, FreeRun};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, State};
use bodyflight_core::flight_sample::FlightSample;
use nalgebra::Vector3;

use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::FlightFrame;

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
    /// Its frames.
    pub samples: Vec<FlightSample>,
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
            samples: frames
                .iter()
                .map(FlightFrame::sample)
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
    pub fn rate(&self, frame: usize) -> PostureRate<f64> {
        let before = frame.saturating_sub(1);
        let after = (frame + 1).min(self.samples.len() - 1);
        PostureRate::between(
            &self.samples[before].posture,
            &self.samples[after].posture,
            self.samples[after].time - self.samples[before].time,
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
        let posture = |frame: usize| &self.samples[if frozen { first } else { frame }].posture;
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
            let duration = self.samples[frame].time - self.samples[frame - 1].time;
            let since_start = self.samples[frame - 1].time - self.samples[0].time;
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
        let mut state =
            State::from_motion(start, &self.dynamics.hold(&self.samples[first].posture));
        let mut motions = vec![*start];
        for frame in first + 1..=last {
            let duration = self.samples[frame].time - self.samples[frame - 1].time;
            let (from, to) = (
                &self.samples[frame - 1].posture,
                &self.samples[frame].posture,
            );
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
        let end = self.samples[first].time + time + 1e-6;
        self.samples
            .partition_point(|sample| sample.time <= end)
            .saturating_sub(1)
            .max(first)
    }
}
