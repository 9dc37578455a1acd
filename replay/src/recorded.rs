//! A recorded flight held in memory, and runs of the model over parts of it.
//!
//! Validation starts the model at many frames of one flight, and the smoothed start runs it several times over the
//! first tenth of a second. Both need random access to frames, which reading a long flight frame by frame does not
//! offer.

use bodyflight_core::body::mass_properties::{MassMotion, PostureRate};
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::free_run::{Crossing, Equations, FreeRun, crossed};
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion, PostureSample, State};
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

    /// Prepares runs of the complete model from frame `first` to `last`.
    pub(crate) fn shared(&self, [first, last]: [usize; 2], equations: Equations) -> Shared<'_> {
        let frames = (first + 1..=last).map(|frame| {
            let duration = self.samples[frame].time - self.samples[frame - 1].time;
            let [from, to] = [frame - 1, frame].map(|frame| &self.samples[frame].posture);
            let mut steps = Vec::new();
            crossed(from, to, duration, |step| {
                let sample = self.dynamics.between(&step.from, &step.to, step.duration);
                steps.push((*step, sample));
            });
            let mut present = PostureSample::blank();
            self.dynamics.pose_into(to, &self.rate(frame), &mut present);
            Reached { steps, present }
        });
        Shared {
            recorded: self,
            first,
            equations,
            frames: frames.collect(),
        }
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

/// A frame as runs reach it.
struct Reached {
    /// The steps that lead to it.
    steps: Vec<(Crossing<f64>, PostureSample<f64>)>,
    /// The sample of its posture, without aerodynamics.
    present: PostureSample<f64>,
}

/// Runs of the complete model over the same frames from different starts, which share the samples of the postures.
pub(crate) struct Shared<'a> {
    recorded: &'a Recorded,
    first: usize,
    equations: Equations,
    /// The frames after the first.
    frames: Vec<Reached>,
}

impl Shared<'_> {
    /// The motions of [`Recorded::run`].
    pub(crate) fn run(&self, start: &Motion<f64>) -> Vec<Motion<f64>> {
        let (recorded, dynamics) = (self.recorded, &self.recorded.dynamics);
        let posture = &recorded.samples[self.first].posture;
        let rate = recorded.rate(self.first);
        let mut run = FreeRun::new(dynamics, self.equations, start, posture, &rate);
        let mut motions = vec![*start];
        for (reached, before) in self.frames.iter().zip(&recorded.samples[self.first..]) {
            let loads = (&recorded.applied, before.time - recorded.samples[0].time);
            for (step, sample) in &reached.steps {
                run.cross(loads, dynamics, &recorded.inputs, (step, sample));
            }
            motions.push(run.flight().motion(&reached.present));
        }
        motions
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::body::pattern;
    use bodyflight_core::frame::{Rotation, Vector};
    use bodyflight_core::{Posture, Segment};
    use nalgebra::UnitQuaternion;

    #[test]
    fn runs_that_share_samples_have_the_bits_of_each_alone() {
        let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.5);
        let motion = Motion {
            inertial_from_body: Rotation::from_quaternion(belly),
            position: Vector::zero(),
            velocity: Vector::new(0.3, -46.0, 2.0),
            angular_velocity: Vector::new(0.1, 0.2, -0.4),
        };
        let posture = |time: f64| -> Posture<f64> {
            pattern::neutral().with_angles(Segment::LeftUpperArm, 0.0, 1.57, 0.2 + time)
        };
        let samples = (0..9_u32).map(|frame| {
            let time = f64::from(frame) / 60.0;
            FlightSample {
                time,
                posture: posture(time),
                motion,
            }
        });
        let subject = crate::subject::Subject::default();
        for equations in [Equations::Exact, Equations::AsPublished] {
            let mut recorded = Recorded {
                samples: samples.clone().collect(),
                dynamics: Dynamics::paper(subject.body(), 1.0),
                inputs: Inputs::belly_turn(),
                applied: AppliedLoads::none(),
            };
            recorded.dynamics.stream.lag = 0.01;
            let (shared, whole) = (
                recorded.shared([2, 7], equations),
                Variant::Whole(equations),
            );
            for speed in [40.0, 50.0] {
                let mut start = motion;
                start.velocity.components.y = -speed;
                assert_eq!(shared.run(&start), recorded.run(2, 7, &start, whole));
            }
        }
    }
}
