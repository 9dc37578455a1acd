//! The body before a stretch, in steps backwards in time: late sensors see the motion there.

use bodyflight_core::dynamics::{Dynamics, PostureSample};
use bodyflight_core::{Posture, Segment};
use nalgebra::UnitQuaternion;

use crate::input::flight::RecordedFlight;
use crate::shooting::intervals::{End, Intervals};
use crate::shooting::stretch::Stretch;

/// A step backwards.
struct Step {
    /// The frame at which it ends, the earlier one.
    before: usize,
    /// Its duration (s).
    duration: f64,
    body: Intervals,
}

/// Steps backwards from the start of a stretch, the latest first.
pub(crate) struct Earlier(Vec<Step>);

impl Earlier {
    /// Steps until `longest` (s) before the stretch, or until the recording begins; `at` has the postures of a frame.
    pub(crate) fn new(
        (track, stretch): (&RecordedFlight, &Stretch),
        longest: f64,
        dynamics: &Dynamics<f64>,
        at: impl Fn(usize) -> End,
    ) -> Self {
        let time = |frame: usize| track.samples[frame].time;
        let (first, back) = (stretch.first, stretch.grid.back);
        let mut steps = Vec::new();
        let mut frame = first;
        while time(first) - time(frame) < longest && frame >= stretch.piece.start + back {
            let before = frame - back;
            let duration = time(frame) - time(before);
            let ends = [at(before), at(frame)].into();
            let body = Intervals::new(ends, dynamics, duration);
            steps.push(Step {
                before,
                duration,
                body,
            });
            frame = before;
        }
        Self(steps)
    }

    /// The frame at which each step ends, its duration (s), and the sample of the body in it.
    pub(crate) fn steps(&self) -> impl Iterator<Item = (usize, f64, &PostureSample<f64>)> {
        let each = self.0.iter();
        each.map(|step| (step.before, step.duration, step.body.at(0).1))
    }

    /// The same steps for another model.
    pub(crate) fn changed(&self, now: &Dynamics<f64>, then: &Dynamics<f64>) -> Self {
        self.each(|step| step.body.changed(now, then))
    }

    /// The same model with another rotation of one joint, given by `turn` for each frame.
    pub(crate) fn with_joint(
        &self,
        dynamics: &Dynamics<f64>,
        back: usize,
        segment: Segment,
        turn: impl Fn(usize, &Posture<f64>) -> Option<UnitQuaternion<f64>>,
    ) -> Self {
        self.each(|step| {
            let turn =
                |end: usize, recorded: &Posture<f64>| turn(step.before + end * back, recorded);
            step.body.with_joint(dynamics, step.duration, segment, turn)
        })
    }

    fn each(&self, body: impl Fn(&Step) -> Intervals) -> Self {
        let step = |step: &Step| Step {
            body: body(step),
            ..*step
        };
        Self(self.0.iter().map(step).collect())
    }
}
