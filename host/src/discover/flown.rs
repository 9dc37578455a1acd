//! The model flying a stretch, and what its sensors see.

use bodyflight_core::Posture;
use bodyflight_core::dynamics::{Motion, PostureSample, State};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use nalgebra::{DVector, SVector};

use super::stretch::{
    CHANNELS, Channels, FRAMES, NUMBERS, SIDE, Stretch, WINDOW, difference, moved, moving, six,
};
use super::track::Track;
use crate::motion_history::MotionHistory;

/// Steps to the true start behind a measured one, at most, and the difference in all channels that is close enough.
const START_STEPS: usize = 12;
const START_CLOSE: f64 = 1e-9;

/// Postures of a stretch as the model flies them.
fn posture(track: &Track, frame: usize, delay: f64) -> Posture<f64> {
    let last = track.postures.len() - 1;
    if delay == 0.0 {
        return track.postures[frame.min(last)];
    }
    // Recorded too late: what is meant now stands further on.
    let interval = track.duration() / last as f64;
    let place = (frame as f64 + delay / interval).clamp(0.0, last as f64);
    let before = place.floor();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the frames"
    )]
    let index = before as usize;
    track.postures[index].interpolated(&track.postures[(index + 1).min(last)], place - before)
}

/// Frames of an interval where only what changes between two flights counts: errors of the longer steps cancel.
pub const COARSE: usize = 3;

/// The intervals of a stretch in a model, ready to be flown from any start.
pub struct Prepared<'a> {
    track: &'a Track,
    model: Model<f64>,
    stretch: &'a Stretch,
    samples: Vec<PostureSample<f64>>,
    /// Frames of an interval.
    stride: usize,
}

impl<'a> Prepared<'a> {
    /// Computes the intervals, each of `stride` frames; `joints` turns recorded postures to those that are flown.
    pub fn new(
        track: &'a Track,
        stretch: &'a Stretch,
        model: &Model<f64>,
        joints: &dyn Fn(Posture<f64>) -> Posture<f64>,
        stride: usize,
    ) -> Self {
        let delay = model.sensors.posture_delay;
        let mut from = joints(posture(track, stretch.first, delay));
        let samples = (stretch.first..stretch.first + FRAMES)
            .step_by(stride)
            .map(|frame| {
                let to = joints(posture(track, frame + stride, delay));
                let duration = track.times[frame + stride] - track.times[frame];
                let sample = model.dynamics.between(&from, &to, duration);
                from = to;
                sample
            })
            .collect();
        Self {
            track,
            model: *model,
            stretch,
            samples,
            stride,
        }
    }

    /// Flies from the smoothed start changed by `start`.
    pub fn fly(&self, start: &Channels) -> Flown {
        let mut seen = Vec::with_capacity(self.samples.len());
        self.each(start, |motion| seen.push(motion));
        Flown {
            seen,
            stride: self.stride,
        }
    }

    fn each(&self, start: &Channels, mut each: impl FnMut(Motion<f64>)) {
        let Some(first) = self.samples.first() else {
            return;
        };
        let begin = self.true_start(&moved(&self.stretch.start, start));
        let inputs = self.model.inputs(&self.track.inputs);
        let times = &self.track.times;
        let time = |k: usize| times[self.stretch.first + k * self.stride] - times[0];
        let mut history = MotionHistory::default();
        let (reach, moments) = (SIDE as f64 * self.stretch.course.apart, 4 * SIDE);
        for k in 0..=moments {
            let later = (k as f64 / moments as f64 - 1.0) * reach;
            history.push(time(0) + later, self.around(&begin, later));
        }
        let mut state = State::from_motion(&begin, first);
        let mut motions = Vec::with_capacity(self.samples.len());
        for (k, sample) in self.samples.iter().enumerate() {
            let duration = time(k + 1) - time(k);
            state = self.model.dynamics.step(&state, sample, &inputs, duration);
            let motion = state.motion(sample);
            history.push(time(k + 1), Moving::of(&motion));
            motions.push(motion);
        }
        for (k, motion) in motions.iter().enumerate() {
            let now = time(k + 1);
            let past = |delay: f64| {
                history
                    .at(now - delay)
                    .unwrap_or_else(|| Moving::of(motion))
            };
            each(self.model.sensors.observe(motion, past, now));
        }
    }

    /// The true start behind a measured one: what sensors see of it is the measured one.
    fn true_start(&self, measured: &Motion<f64>) -> Motion<f64> {
        let time = self.track.times[self.stretch.first] - self.track.times[0];
        let mut start = *measured;
        for _ in 0..START_STEPS {
            let past = |delay: f64| self.around(&start, -delay);
            let seen = self.model.sensors.observe(&start, past, time);
            let missing = difference(measured, &seen);
            start = moved(&start, &missing);
            if missing.norm() < START_CLOSE {
                break;
            }
        }
        start
    }

    /// The moving `later` (s) than at a start, as it goes on around the start. What was measured there is late itself.
    fn around(&self, start: &Motion<f64>, later: f64) -> Moving<f64> {
        let course = &self.stretch.course;
        let sensors = &self.model.sensors;
        let change = |late: f64| course.change(later + late) - course.change(late);
        let (velocity, spin) = (change(sensors.velocity_latency), change(sensors.rate_lag));
        let now = six(&Moving::of(start));
        moving(&SVector::from_fn(|row, _| {
            now[row] + if row < 3 { velocity[row] } else { spin[row] }
        }))
    }
}

/// What sensors see of a flown stretch.
#[derive(Debug, Clone)]
pub struct Flown {
    /// After each interval.
    seen: Vec<Motion<f64>>,
    /// Frames of an interval.
    stride: usize,
}

impl Flown {
    /// What was measured less what is seen here, averaged.
    pub fn missing(&self, track: &Track, stretch: &Stretch) -> DVector<f64> {
        let measured = |k: usize| &track.measured[stretch.first + (k + 1) * self.stride];
        self.averaged(|k, seen| difference(measured(k), seen))
    }

    /// What is seen here less what is seen in `other`, of the same stride, averaged.
    pub fn less(&self, other: &Self) -> DVector<f64> {
        self.averaged(|k, seen| difference(seen, &other.seen[k]))
    }

    fn averaged(&self, difference: impl Fn(usize, &Motion<f64>) -> Channels) -> DVector<f64> {
        let mut averages = DVector::zeros(NUMBERS);
        let share = self.stride as f64 / WINDOW as f64;
        for (k, seen) in self.seen.iter().enumerate() {
            let row = k * self.stride / WINDOW;
            for (channel, value) in difference(k, seen).iter().enumerate() {
                averages[row * CHANNELS + channel] += value * share;
            }
        }
        averages
    }
}
