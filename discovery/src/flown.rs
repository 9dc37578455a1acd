//! The model flying a stretch, and what its sensors see.

use std::rc::Rc;

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::{Motion, PostureSample, State};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use nalgebra::{DVector, SVector};

use super::motion_history::MotionHistory;
use super::nuisance::Nuisance;
use super::stretch::{
    CHANNELS, Channels, FRAMES, NUMBERS, SIDE, Stretch, WINDOW, difference, moved, moving, six,
};
use super::track::Track;

/// Steps to the true motion behind a measured one, at most, and the difference in all channels that is close enough.
const BEHIND_STEPS: usize = 12;
const BEHIND_CLOSE: f64 = 1e-9;

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
pub const COARSE: usize = 6;

/// A posture in the middle of an interval, and how it changes.
type Posed = (Posture<f64>, PostureRate<f64>);

/// The intervals of a stretch in a model, ready to be flown from any start.
pub struct Prepared<'a> {
    track: &'a Track,
    stretch: &'a Stretch,
    /// With the subject as it is.
    model: Model<f64>,
    nuisance: Nuisance,
    /// Frames of an interval.
    stride: usize,
    postures: Rc<[Posed]>,
    samples: Rc<[PostureSample<f64>]>,
}

impl<'a> Prepared<'a> {
    /// Computes the intervals, each of `stride` frames, in a model with what joints and subject have wrong.
    pub fn new(
        track: &'a Track,
        stretch: &'a Stretch,
        model: &Model<f64>,
        nuisance: &Nuisance,
        stride: usize,
    ) -> Self {
        let model = nuisance.of(model);
        let joints = nuisance.joints();
        let at = |frame: usize| joints(&posture(track, frame, model.sensors.posture_delay));
        let mut from = at(stretch.first);
        let postures: Rc<[Posed]> = (stretch.first..stretch.first + FRAMES)
            .step_by(stride)
            .map(|frame| {
                let to = at(frame + stride);
                let duration = track.times[frame + stride] - track.times[frame];
                let posed = (
                    from.interpolated(&to, 0.5),
                    PostureRate::between(&from, &to, duration),
                );
                from = to;
                posed
            })
            .collect();
        Self {
            track,
            stretch,
            samples: sampled(&model, &postures),
            model,
            nuisance: nuisance.clone(),
            stride,
            postures,
        }
    }

    /// The same intervals in another model: what that does not change is kept.
    pub fn changed_to(&self, model: &Model<f64>, nuisance: &Nuisance) -> Self {
        if !self.nuisance.has_joints_of(nuisance) || self.model.sensors != model.sensors {
            return Self::new(self.track, self.stretch, model, nuisance, self.stride);
        }
        let model = nuisance.of(model);
        let [now, then] = [&self.model.dynamics, &model.dynamics];
        let same = now.body == then.body
            && now.aerodynamics == then.aerodynamics
            && now.stream == then.stream;
        Self {
            samples: if same {
                self.samples.clone()
            } else {
                sampled(&model, &self.postures)
            },
            model,
            nuisance: nuisance.clone(),
            postures: self.postures.clone(),
            ..*self
        }
    }

    /// Flies from the smoothed start changed by `start`.
    pub fn fly(&self, start: &Channels) -> Flown {
        let mut seen = Vec::with_capacity(self.samples.len() + 1);
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
        let measured = moved(&self.stretch.start, start);
        let begin = self.true_start(&measured);
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
        each(measured);
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

    fn true_start(&self, measured: &Motion<f64>) -> Motion<f64> {
        let time = self.track.times[self.stretch.first] - self.track.times[0];
        behind(measured, |start| {
            let past = |delay: f64| self.around(start, -delay);
            self.model.sensors.observe(start, past, time)
        })
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

/// The true motion behind a measured one: what sensors see of it, by `observe`, is the measured one.
pub(super) fn behind(
    measured: &Motion<f64>,
    observe: impl Fn(&Motion<f64>) -> Motion<f64>,
) -> Motion<f64> {
    let mut motion = *measured;
    for _ in 0..BEHIND_STEPS {
        let missing = difference(measured, &observe(&motion));
        motion = moved(&motion, &missing);
        if missing.norm() < BEHIND_CLOSE {
            break;
        }
    }
    motion
}

/// What loads and mass owe to the postures.
fn sampled(model: &Model<f64>, postures: &[Posed]) -> Rc<[PostureSample<f64>]> {
    let sample = |(posture, rate): &Posed| model.dynamics.sample(posture, rate);
    postures.iter().map(sample).collect()
}

/// What sensors see of a flown stretch.
#[derive(Debug, Clone)]
pub struct Flown {
    /// At the start and after each interval.
    seen: Vec<Motion<f64>>,
    /// Frames of an interval.
    stride: usize,
}

impl Flown {
    /// What was measured less what is seen here, averaged.
    pub fn missing(&self, track: &Track, stretch: &Stretch) -> DVector<f64> {
        let measured = |k: usize| &track.measured[stretch.first + k * self.stride];
        self.averaged(|k, seen| difference(measured(k), seen))
    }

    /// What is seen here less what is seen in `other`, of the same stride, averaged.
    pub fn less(&self, other: &Self) -> DVector<f64> {
        self.averaged(|k, seen| difference(seen, &other.seen[k]))
    }

    /// The mean of the frames after the start of each window, linear between those that were flown.
    fn averaged(&self, difference: impl Fn(usize, &Motion<f64>) -> Channels) -> DVector<f64> {
        let mut averages = DVector::zeros(NUMBERS);
        let stride = self.stride as f64;
        let [early, late] = [stride - 1.0, stride + 1.0].map(|share| share / (2 * WINDOW) as f64);
        let mut before = Channels::zeros();
        for (k, seen) in self.seen.iter().enumerate() {
            let now = difference(k, seen);
            if let Some(interval) = k.checked_sub(1) {
                let row = interval * self.stride / WINDOW;
                let mut mean = averages.rows_mut(row * CHANNELS, CHANNELS);
                mean += before * early + now * late;
            }
            before = now;
        }
        averages
    }
}
