//! Simulates a stretch from any start: its intervals with their postures, and the readings of the sensors.

use std::cell::OnceCell;

use bodyflight_core::dynamics::{Inputs, Motion, PostureSample, State};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::history::moving_at;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::frame::Vector;
use bodyflight_core::{Posture, Segment};
use nalgebra::{DVector, Vector3};

use crate::input::flight::RecordedFlight;
use crate::shooting::earlier::Earlier;
use crate::shooting::intervals::{End, Intervals};
use crate::shooting::joint_error::JointErrors;
use crate::shooting::perturbation::{InputPerturbation, UnknownWrench};
use crate::shooting::prediction::Prediction;
use crate::shooting::stretch::{Channels, Stretch, difference, moved};

/// Maximum number of iterations to find the true motion for a measured one, and the difference over all channels at
/// which they stop.
const BEHIND_STEPS: usize = 12;
const BEHIND_CLOSE: f64 = 1e-9;

/// Longest sensor delay for which the motion before a stretch is computed (s); longer ones count as this one.
const LONGEST_DELAY: f64 = 0.33;

/// Length of the integration steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Steps {
    /// For comparisons with the measurement.
    Short,
    /// For differences between two simulations, in which integration errors cancel.
    Long,
}

impl Steps {
    /// Number of intervals before and after the stretch that are sampled too.
    pub(crate) const fn margin(self) -> usize {
        match self {
            Self::Short => 1,
            Self::Long => 0,
        }
    }
}

/// The intervals of a stretch, prepared for simulation from any start.
pub(crate) struct Simulator<'a> {
    pub(crate) track: &'a RecordedFlight,
    pub(crate) stretch: &'a Stretch,
    pub(crate) model: Model<f64>,
    pub(crate) joints: JointErrors,
    pub(crate) steps: Steps,
    /// Number of intervals in the stretch.
    pub(crate) count: usize,
    /// The body in the intervals. With short steps, these include an interval before the stretch and one after it.
    intervals: Intervals,
    /// The body before the stretch, once a late sensor asked for it.
    earlier: OnceCell<Earlier>,
    varied: Option<InputPerturbation>,
}

impl<'a> Simulator<'a> {
    /// Prepares the intervals for a model and given joint errors.
    pub(crate) fn new(
        track: &'a RecordedFlight,
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
        let margin = steps.margin();
        let at = |k: usize| {
            let after = (k as f64 - margin as f64) * frames as f64 / count as f64;
            let place = stretch.first as f64 + after;
            let recorded = track.posture_at(place, model.sensors.posture_delay, &stretch.piece);
            let over_stretch = over_stretch(k, margin, count);
            [recorded, joints.correct(&recorded, over_stretch)]
        };
        let ends = (0..=count + 2 * margin).map(at).collect();
        let duration = duration(track, stretch, count);
        Self {
            track,
            stretch,
            model: *model,
            joints: joints.clone(),
            steps,
            count,
            intervals: Intervals::new(ends, &model.dynamics, duration),
            earlier: OnceCell::new(),
            varied: None,
        }
    }

    /// Time of a frame (s).
    fn time(&self, frame: usize) -> f64 {
        self.track.samples[frame].time
    }

    /// The same intervals for another model. Whatever does not depend on the change is reused.
    pub(crate) fn changed_to(&self, model: &Model<f64>) -> Self {
        // Of the sensors' errors, only this one moves the postures.
        if model.sensors.posture_delay - self.model.sensors.posture_delay != 0.0 {
            return Self::new(self.track, self.stretch, model, &self.joints, self.steps);
        }
        let [now, then] = [&self.model.dynamics, &model.dynamics];
        let is_as_late = longest_delay(&self.model) - longest_delay(model) == 0.0;
        let earlier = self.earlier.get().filter(|_| is_as_late);
        Self {
            model: *model,
            joints: self.joints.clone(),
            intervals: self.intervals.changed(now, then),
            earlier: known(earlier.map(|earlier| earlier.changed(now, then))),
            ..*self
        }
    }

    /// The same model with other errors of one joint, given by its index among the segments that have a parent.
    pub(crate) fn with_joint(&self, joints: &JointErrors, joint: usize) -> Self {
        let margin = self.steps.margin();
        let turn = |k: usize, recorded: &Posture<f64>| {
            let place = over_stretch(k, margin, self.count);
            joints.corrected_joint(recorded, place, joint)
        };
        let turn_before = |frame: usize, recorded: &Posture<f64>| {
            joints.corrected_joint(recorded, self.place(frame), joint)
        };
        let duration = duration(self.track, self.stretch, self.count);
        let (dynamics, segment) = (&self.model.dynamics, Segment::ALL[joint + 1]);
        let back = self.stretch.grid.back;
        let earlier = self.earlier.get();
        let earlier =
            earlier.map(|earlier| earlier.with_joint(dynamics, back, segment, turn_before));
        Self {
            joints: joints.clone(),
            intervals: self.intervals.with_joint(dynamics, duration, segment, turn),
            earlier: known(earlier),
            ..*self
        }
    }

    /// The same model with air or inputs that differ in one window.
    pub(crate) fn with_varied(&self, varied: InputPerturbation) -> Self {
        let mut other = self.changed_to(&self.model);
        other.varied = Some(varied);
        other
    }

    /// The posture and the sample of an interval.
    pub(crate) fn interval(&self, k: usize) -> (&Posture<f64>, &PostureSample<f64>) {
        let place = k + self.steps.margin();
        self.intervals.at(place)
    }

    /// The samples of the intervals before and after the given end of an interval.
    fn around(&self, end: usize) -> [&PostureSample<f64>; 2] {
        let place = end + self.steps.margin();
        let last = self.intervals.count() - 1;
        [place.saturating_sub(1), place.min(last)].map(|place| self.intervals.at(place).1)
    }

    /// The state at the start of the stretch. A sample has the posture of the middle of its interval; that of the start
    /// is the mean of two.
    pub(crate) fn start_state(&self, motion: &Motion<f64>) -> State<f64> {
        let [before, after] = self.around(0);
        let mut state = State::from_motion(motion, before);
        let other = State::from_motion(motion, after);
        state.cg_position = mean(&state.cg_position, &other.cg_position);
        state.linear_momentum = mean(&state.linear_momentum, &other.linear_momentum);
        state.angular_momentum = mean(&state.angular_momentum, &other.angular_momentum);
        state
    }

    /// The motion at the end of an interval, likewise.
    pub(crate) fn end_motion(&self, state: &State<f64>, end: usize) -> Motion<f64> {
        let [before, after] = self.around(end);
        let mut motion = state.motion(before);
        let other = state.motion(after);
        motion.position = mean(&motion.position, &other.position);
        motion.velocity = mean(&motion.velocity, &other.velocity);
        motion.angular_velocity = mean(&motion.angular_velocity, &other.angular_velocity);
        motion
    }

    /// The residuals of the stretch simulated in this way.
    pub(crate) fn residual(&self, start: &Channels, push: Option<UnknownWrench>) -> DVector<f64> {
        self.fly(start, push).residual(self.track, self.stretch)
    }

    /// Simulates the stretch from its smoothed start, changed by `start`, with an optional push in one window.
    fn fly(&self, start: &Channels, push: Option<UnknownWrench>) -> Prediction {
        let grid = self.stretch.grid;
        let count = self.count;
        let first = self.stretch.first;
        let begin_time = self.time(first) - self.time(0);
        let duration = duration(self.track, self.stretch, count);
        let time = |k: usize| begin_time + duration * k as f64;
        let (kept, stride) = match self.steps {
            Steps::Short => (grid.parts, 1),
            Steps::Long => (1, grid.stride),
        };
        let mut seen = Vec::with_capacity(count / kept + 1);
        let measured = moved(&self.stretch.start, start);
        seen.push(measured);
        let sensors = &self.model.sensors;
        let late = sensors.velocity_latency != 0.0 || sensors.rate_lag != 0.0;
        let past = if late {
            self.past(&measured)
        } else {
            Vec::new()
        };
        let begin = self.true_start(&measured, &past);
        let mut history = Vec::new();
        for (earlier, change) in past.iter().rev() {
            history.push((begin_time - earlier, shifted(&Moving::of(&begin), change)));
        }
        let mut state = self.start_state(&begin);
        let mut motions = Vec::with_capacity(count);
        let dynamics = &self.model.dynamics;
        for k in 0..count {
            let frame = first + (2 * k + 1) * grid.frames() / (2 * count);
            let inputs = self.model.inputs(&self.track.inputs[frame]);
            let body = self.interval(k);
            let (_, sample) = body;
            let apply = |state: &mut State<f64>, time: f64| {
                let loads = &self.model.applied;
                loads.push(dynamics, state, body, time, 0.5 * duration);
            };
            apply(&mut state, time(k));
            let window = k * grid.rows / count;
            state = self.stepped(&state, sample, &inputs, window, duration);
            apply(&mut state, time(k + 1));
            if let Some(push) = push
                && push.window == window
            {
                push.act_on(&mut state, sample, duration);
            }
            let motion = self.end_motion(&state, k + 1);
            if late {
                history.push((time(k + 1), Moving::of(&motion)));
            }
            motions.push(motion);
        }
        for (k, motion) in motions.iter().enumerate() {
            if (k + 1) % kept != 0 {
                continue;
            }
            let now = time(k + 1);
            let past =
                |delay: f64| moving_at(&history, now - delay).unwrap_or_else(|| Moving::of(motion));
            seen.push(sensors.observe(motion, past, now));
        }
        Prediction { seen, stride }
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
        let now = Moving::of(start);
        let mut past = vec![(0.0, [Vector3::zeros(); 2])];
        let mut state: Option<State<f64>> = None;
        let first = self.time(self.stretch.first);
        let earlier = self.earlier.get_or_init(|| {
            let longest = longest_delay(&self.model);
            let place = (self.track, self.stretch);
            Earlier::new(place, longest, &self.model.dynamics, |frame| {
                self.end(frame)
            })
        });
        for (before, duration, sample) in earlier.steps() {
            let inputs = self.model.inputs(&self.track.inputs[before]);
            let from = state.unwrap_or_else(|| State::from_motion(start, sample));
            let then = self.model.dynamics.step(&from, sample, &inputs, -duration);
            let moving = Moving::of(&then.motion(sample));
            let change = [
                moving.velocity.components - now.velocity.components,
                moving.angular_velocity.components - now.angular_velocity.components,
            ];
            past.push((first - self.time(before), change));
            state = Some(then);
        }
        past
    }

    /// The posture of a frame, as recorded and as corrected.
    fn end(&self, frame: usize) -> End {
        let delay = self.model.sensors.posture_delay;
        let piece = &self.stretch.piece;
        let recorded = self.track.posture_at(frame as f64, delay, piece);
        [recorded, self.joints.correct(&recorded, self.place(frame))]
    }

    /// Position of a frame within the stretch, from -1 to 1; less than -1 before it.
    fn place(&self, frame: usize) -> f64 {
        let after = frame as f64 - self.stretch.first as f64;
        2.0 * after / self.stretch.grid.frames() as f64 - 1.0
    }

    fn true_start(&self, measured: &Motion<f64>, past: &[(f64, [Vector3<f64>; 2])]) -> Motion<f64> {
        let time = self.time(self.stretch.first) - self.time(0);
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

/// The longest delay of a sensor (s) for which the motion before a stretch is computed.
fn longest_delay(model: &Model<f64>) -> f64 {
    let sensors = &model.sensors;
    let longest = sensors.velocity_latency.max(sensors.rate_lag);
    longest.min(LONGEST_DELAY)
}

/// A cell with what is known, or empty.
fn known<V>(value: Option<V>) -> OnceCell<V> {
    value.map_or_else(OnceCell::new, OnceCell::from)
}

fn mean<F>(a: &Vector<f64, F>, b: &Vector<f64, F>) -> Vector<f64, F> {
    Vector::from_components((a.components + b.components) * 0.5)
}

/// Position of an interval's end within the stretch, from -1 to 1. The first `margin` ends are before it.
fn over_stretch(k: usize, margin: usize, count: usize) -> f64 {
    2.0 * (k as f64 - margin as f64) / count as f64 - 1.0
}

/// Duration of each of `count` intervals in a stretch (s).
fn duration(track: &RecordedFlight, stretch: &Stretch, count: usize) -> f64 {
    let time = |frame: usize| track.samples[frame].time;
    (time(stretch.first + stretch.grid.frames()) - time(stretch.first)) / count as f64
}

/// The motion with velocity and angular velocity changed.
fn shifted(moving: &Moving<f64>, change: &[Vector3<f64>; 2]) -> Moving<f64> {
    Moving {
        velocity: Vector::from_components(moving.velocity.components + change[0]),
        angular_velocity: Vector::from_components(moving.angular_velocity.components + change[1]),
    }
}

/// The true motion for which `observe` returns the measured one.
fn behind(measured: &Motion<f64>, observe: impl Fn(&Motion<f64>) -> Motion<f64>) -> Motion<f64> {
    let mut motion = *measured;
    for _ in 0..BEHIND_STEPS {
        let residual = difference(measured, &observe(&motion));
        motion = moved(&motion, &residual);
        if residual.norm() < BEHIND_CLOSE {
            break;
        }
    }
    motion
}
