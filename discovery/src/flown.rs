//! Simulates a stretch and the readings of its sensors.

use std::rc::Rc;

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::{Inputs, Motion, PostureSample, State};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::frame::Vector;
use nalgebra::{DVector, Vector3};

use super::motion_history::MotionHistory;
use super::nuisance::JointErrors;
use super::stretch::{CHANNELS, Channels, NUMBERS, Stretch, difference, moved};
use super::track::Track;
use super::window::{Push, Varied};

/// Maximum number of iterations to find the true motion for a measured one, and the difference over all channels at
/// which they stop.
const BEHIND_STEPS: usize = 12;
const BEHIND_CLOSE: f64 = 1e-9;

/// Longest sensor delay for which the motion before a stretch is computed (s); longer ones count as this one.
const LONGEST_DELAY: f64 = 0.33;

/// The recorded posture at a fractional frame index, for a recording that lags by `delay` (s).
fn posture(track: &Track, place: f64, delay: f64) -> Posture<f64> {
    let last = track.postures.len() - 1;
    let interval = track.duration() / last as f64;
    let place = (place + delay / interval).clamp(0.0, last as f64);
    let before = place.floor();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to the frames"
    )]
    let index = before as usize;
    if place <= before {
        return track.postures[index];
    }
    track.postures[index].interpolated(&track.postures[(index + 1).min(last)], place - before)
}

/// Length of the integration steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Steps {
    /// For comparisons with the measurement.
    Short,
    /// For differences between two simulations, in which integration errors cancel.
    Long,
}

/// The posture in the middle of an interval, and its rate of change.
type Posed = (Posture<f64>, PostureRate<f64>);

/// The intervals of a stretch, prepared for simulation from any start.
pub struct Prepared<'a> {
    track: &'a Track,
    stretch: &'a Stretch,
    model: Model<f64>,
    joints: JointErrors,
    steps: Steps,
    /// Postures at the ends of the intervals: recorded and corrected.
    ends: Rc<[[Posture<f64>; 2]]>,
    postures: Rc<[Posed]>,
    samples: Rc<[PostureSample<f64>]>,
    varied: Option<Varied>,
}

impl<'a> Prepared<'a> {
    /// Prepares the intervals for a model and given joint errors.
    pub fn new(
        track: &'a Track,
        stretch: &'a Stretch,
        model: &Model<f64>,
        joints: &JointErrors,
        steps: Steps,
    ) -> Self {
        let grid = stretch.grid;
        let frames = grid.frames();
        let count = match steps {
            Steps::Short => frames * grid.parts,
            Steps::Long => frames / grid.stride,
        };
        let place = |k: usize| stretch.first as f64 + (k * frames) as f64 / count as f64;
        let at = |k: usize| {
            let recorded = posture(track, place(k), model.sensors.posture_delay);
            [recorded, joints.correct(&recorded, over_stretch(k, count))]
        };
        let prepared = Self {
            track,
            stretch,
            samples: Rc::default(),
            model: *model,
            joints: joints.clone(),
            steps,
            ends: (0..=count).map(at).collect(),
            postures: Rc::default(),
            varied: None,
        };
        prepared.posed()
    }

    /// Derives the postures within the intervals from those at their ends.
    fn posed(mut self) -> Self {
        let frames = self.stretch.grid.frames();
        let first = self.stretch.first;
        let times = &self.track.times;
        let count = self.ends.len() - 1;
        let duration = (times[first + frames] - times[first]) / count as f64;
        let posed = |pair: &[[Posture<f64>; 2]]| {
            let [from, to] = [&pair[0][1], &pair[1][1]];
            (
                from.interpolated(to, 0.5),
                PostureRate::between(from, to, duration),
            )
        };
        self.postures = self.ends.windows(2).map(posed).collect();
        self.samples = sampled(&self.model, &self.postures);
        self
    }

    /// The same intervals for another model. Whatever does not depend on the change is reused.
    pub fn changed_to(&self, model: &Model<f64>) -> Self {
        if self.model.sensors != model.sensors {
            return Self::new(self.track, self.stretch, model, &self.joints, self.steps);
        }
        let [now, then] = [&self.model.dynamics, &model.dynamics];
        let same = now.body == then.body
            && now.aerodynamics == then.aerodynamics
            && now.stream == then.stream;
        Self {
            samples: if same {
                self.samples.clone()
            } else {
                sampled(model, &self.postures)
            },
            model: *model,
            joints: self.joints.clone(),
            ends: self.ends.clone(),
            postures: self.postures.clone(),
            ..*self
        }
    }

    /// The same model with other errors of one joint, given by its index among the segments that have a parent.
    pub fn with_joint(&self, joints: &JointErrors, joint: usize) -> Self {
        let count = self.ends.len() - 1;
        let changed = |(k, [recorded, posture]): (usize, &[Posture<f64>; 2])| {
            let mut posture = *posture;
            joints.correct_joint(recorded, over_stretch(k, count), joint, &mut posture);
            [*recorded, posture]
        };
        let prepared = Self {
            ends: self.ends.iter().enumerate().map(changed).collect(),
            samples: Rc::default(),
            postures: Rc::default(),
            joints: joints.clone(),
            ..*self
        };
        prepared.posed()
    }

    /// The same model with air or inputs that differ in one window.
    pub fn with_varied(&self, varied: Varied) -> Self {
        let mut other = self.changed_to(&self.model);
        other.varied = Some(varied);
        other
    }

    /// Simulates the stretch from its smoothed start, changed by `start`, with an optional push in one window.
    pub fn fly(&self, start: &Channels, push: Option<Push>) -> Flown {
        let grid = self.stretch.grid;
        let count = self.samples.len();
        let first = self.stretch.first;
        let times = &self.track.times;
        let begin_time = times[first] - times[0];
        let duration = (times[first + grid.frames()] - times[first]) / count as f64;
        let time = |k: usize| begin_time + duration * k as f64;
        let (kept, stride) = match self.steps {
            Steps::Short => (grid.parts, 1),
            Steps::Long => (1, grid.stride),
        };
        let mut seen = Vec::with_capacity(count / kept + 1);
        let measured = moved(&self.stretch.start, start);
        seen.push(measured);
        let Some(sample) = self.samples.first() else {
            return Flown { seen, stride };
        };
        let sensors = &self.model.sensors;
        let late = sensors.velocity_latency != 0.0 || sensors.rate_lag != 0.0;
        let past = if late {
            self.past(&measured)
        } else {
            Vec::new()
        };
        let begin = self.true_start(&measured, &past);
        let mut history = MotionHistory::default();
        for (earlier, change) in past.iter().rev() {
            history.push(begin_time - earlier, shifted(&Moving::of(&begin), change));
        }
        let mut state = State::from_motion(&begin, sample);
        let mut motions = Vec::with_capacity(count);
        let dynamics = &self.model.dynamics;
        for (k, sample) in self.samples.iter().enumerate() {
            let frame = first + (2 * k + 1) * grid.frames() / (2 * count);
            let inputs = self.model.inputs(&self.track.inputs[frame]);
            let body = (&self.postures[k].0, sample);
            let apply = |state: &mut State<f64>, time: f64| {
                let loads = &self.model.applied;
                loads.push(dynamics, state, body, time, 0.5 * duration);
            };
            apply(&mut state, time(k));
            let window = k * super::stretch::ROWS / count;
            state = self.stepped(&state, sample, &inputs, window, duration);
            apply(&mut state, time(k + 1));
            if let Some(push) = push
                && push.window == window
            {
                push.act_on(&mut state, sample, duration);
            }
            let motion = state.motion(sample);
            if late {
                history.push(time(k + 1), Moving::of(&motion));
            }
            motions.push(motion);
        }
        for (k, motion) in motions.iter().enumerate() {
            if (k + 1) % kept != 0 {
                continue;
            }
            let now = time(k + 1);
            let past = |delay: f64| {
                history
                    .at(now - delay)
                    .unwrap_or_else(|| Moving::of(motion))
            };
            seen.push(sensors.observe(motion, past, now));
        }
        Flown { seen, stride }
    }

    /// The state after a step in a window of the stretch.
    fn stepped(
        &self,
        state: &State<f64>,
        sample: &PostureSample<f64>,
        inputs: &Inputs<f64>,
        window: usize,
        duration: f64,
    ) -> State<f64> {
        let dynamics = &self.model.dynamics;
        match &self.varied {
            None => dynamics.step(state, sample, inputs, duration),
            Some(varied) => {
                let (dynamics, inputs) = varied.applied(window, dynamics, inputs);
                dynamics.step(state, sample, &inputs, duration)
            }
        }
    }

    /// The motion before a start: how much earlier it is (s), and by how much velocity and angular velocity differ.
    ///
    /// The motion comes from a simulation backwards in time. The measurement itself would not do, because its noise
    /// also enters the first comparisons, and a sensor that follows this noise would seem late.
    fn past(&self, start: &Motion<f64>) -> Vec<(f64, [Vector3<f64>; 2])> {
        let grid = self.stretch.grid;
        let first = self.stretch.first;
        let times = &self.track.times;
        let delay = self.model.sensors.posture_delay;
        let length = grid.frames() as f64;
        let at = |frame: usize| {
            let place = 2.0 * (frame as f64 - first as f64) / length - 1.0;
            self.joints
                .correct(&posture(self.track, frame as f64, delay), place)
        };
        let now = Moving::of(start);
        let mut past = vec![(0.0, [Vector3::zeros(); 2])];
        let mut state: Option<State<f64>> = None;
        let mut frame = first;
        let sensors = &self.model.sensors;
        let longest = sensors.velocity_latency.max(sensors.rate_lag);
        while times[first] - times[frame] < longest.min(LONGEST_DELAY) && frame >= grid.back {
            let before = frame - grid.back;
            let duration = times[frame] - times[before];
            let sample = self
                .model
                .dynamics
                .between(&at(before), &at(frame), duration);
            let inputs = self.model.inputs(&self.track.inputs[before]);
            let from = state.unwrap_or_else(|| State::from_motion(start, &sample));
            let then = self.model.dynamics.step(&from, &sample, &inputs, -duration);
            let moving = Moving::of(&then.motion(&sample));
            let change = [
                moving.velocity.components - now.velocity.components,
                moving.angular_velocity.components - now.angular_velocity.components,
            ];
            past.push((times[first] - times[before], change));
            (state, frame) = (Some(then), before);
        }
        past
    }

    fn true_start(&self, measured: &Motion<f64>, past: &[(f64, [Vector3<f64>; 2])]) -> Motion<f64> {
        let time = self.track.times[self.stretch.first] - self.track.times[0];
        behind(measured, |start| {
            let now = Moving::of(start);
            let at = |delay: f64| {
                let after = past.partition_point(|(earlier, _)| *earlier < delay);
                let (Some((late, from)), Some((early, to))) =
                    (past.get(after), past.get(after.saturating_sub(1)))
                else {
                    return past.last().map_or(now, |(_, change)| shifted(&now, change));
                };
                let share = if late > early {
                    (delay - early) / (late - early)
                } else {
                    0.0
                };
                shifted(&now, &[0, 1].map(|k| to[k] + (from[k] - to[k]) * share))
            };
            self.model.sensors.observe(start, at, time)
        })
    }
}

/// The motion with velocity and angular velocity changed.
fn shifted(moving: &Moving<f64>, change: &[Vector3<f64>; 2]) -> Moving<f64> {
    Moving {
        velocity: Vector::from_components(moving.velocity.components + change[0]),
        angular_velocity: Vector::from_components(moving.angular_velocity.components + change[1]),
    }
}

/// The true motion for which `observe` returns the measured one.
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

/// Position of an interval's end within the stretch, from -1 to 1.
fn over_stretch(k: usize, count: usize) -> f64 {
    2.0 * k as f64 / count as f64 - 1.0
}

/// Samples the loads and mass properties that depend only on the postures.
fn sampled(model: &Model<f64>, postures: &[Posed]) -> Rc<[PostureSample<f64>]> {
    let sample = |(posture, rate): &Posed| model.dynamics.sample(posture, rate);
    postures.iter().map(sample).collect()
}

/// Sensor readings of a simulated stretch.
#[derive(Debug, Clone)]
pub struct Flown {
    /// Readings at the start and after each interval.
    seen: Vec<Motion<f64>>,
    /// Number of frames in an interval.
    stride: usize,
}

impl Flown {
    /// Averaged residuals: measured less simulated.
    pub fn missing(&self, track: &Track, stretch: &Stretch) -> DVector<f64> {
        let measured = |k: usize| &track.measured[stretch.first + k * self.stride];
        self.averaged(stretch.grid.window, |k, seen| difference(measured(k), seen))
    }

    /// Averaged differences from another simulation with the same stride.
    pub fn less(&self, other: &Self, stretch: &Stretch) -> DVector<f64> {
        self.averaged(stretch.grid.window, |k, seen| {
            difference(seen, &other.seen[k])
        })
    }

    /// Averages over the frames of each window after its start, with linear interpolation between simulated frames.
    fn averaged(
        &self,
        window: usize,
        difference: impl Fn(usize, &Motion<f64>) -> Channels,
    ) -> DVector<f64> {
        let mut averages = DVector::zeros(NUMBERS);
        let stride = self.stride as f64;
        let [early, late] = [stride - 1.0, stride + 1.0].map(|share| share / (2 * window) as f64);
        let mut before = Channels::zeros();
        for (k, seen) in self.seen.iter().enumerate() {
            let now = difference(k, seen);
            if let Some(interval) = k.checked_sub(1) {
                let row = interval * self.stride / window;
                let mut mean = averages.rows_mut(row * CHANNELS, CHANNELS);
                mean += before * early + now * late;
            }
            before = now;
        }
        averages
    }
}
