//! The intervals of a stretch: postures and samples, prepared for simulation from any start.

use std::rc::Rc;

use bodyflight_core::Posture;
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_core::dynamics::{Motion, PostureSample, State};
use bodyflight_core::effect::Model;
use bodyflight_core::frame::Vector;

use super::nuisance::JointErrors;
use super::stretch::Stretch;
use super::track::Track;
use super::window::Varied;

/// The recorded posture at a fractional frame index, for a recording that lags by `delay` (s).
pub(super) fn posture(track: &Track, place: f64, delay: f64) -> Posture<f64> {
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

impl Steps {
    /// Number of intervals before and after the stretch that are sampled too.
    pub(super) const fn margin(self) -> usize {
        match self {
            Self::Short => 1,
            Self::Long => 0,
        }
    }
}

/// The posture in the middle of an interval, and its rate of change.
type Posed = (Posture<f64>, PostureRate<f64>);

/// The intervals of a stretch, prepared for simulation from any start.
pub struct Prepared<'a> {
    pub(super) track: &'a Track,
    pub(super) stretch: &'a Stretch,
    pub(super) model: Model<f64>,
    pub(super) joints: JointErrors,
    pub(super) steps: Steps,
    /// Number of intervals in the stretch.
    pub(super) count: usize,
    /// Postures at the ends of the intervals: recorded and corrected. With short steps, these and the following lists
    /// include an interval before the stretch and one after it.
    ends: Rc<[[Posture<f64>; 2]]>,
    postures: Rc<[Posed]>,
    samples: Rc<[PostureSample<f64>]>,
    pub(super) varied: Option<Varied>,
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
        let margin = steps.margin();
        let at = |k: usize| {
            let after = (k as f64 - margin as f64) * frames as f64 / count as f64;
            let place = stretch.first as f64 + after;
            let recorded = posture(track, place, model.sensors.posture_delay);
            let over_stretch = over_stretch(k, margin, count);
            [recorded, joints.correct(&recorded, over_stretch)]
        };
        let prepared = Self {
            track,
            stretch,
            samples: Rc::default(),
            model: *model,
            joints: joints.clone(),
            steps,
            count,
            ends: (0..=count + 2 * margin).map(at).collect(),
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
        let duration = (times[first + frames] - times[first]) / self.count as f64;
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
        let margin = self.steps.margin();
        let changed = |(k, [recorded, posture]): (usize, &[Posture<f64>; 2])| {
            let mut posture = *posture;
            let place = over_stretch(k, margin, self.count);
            joints.correct_joint(recorded, place, joint, &mut posture);
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

    /// The posture and the sample of an interval.
    pub(super) fn interval(&self, k: usize) -> (&Posture<f64>, &PostureSample<f64>) {
        let place = k + self.steps.margin();
        (&self.postures[place].0, &self.samples[place])
    }

    /// The samples of the intervals before and after the given end of an interval.
    fn around(&self, end: usize) -> [&PostureSample<f64>; 2] {
        let place = end + self.steps.margin();
        let last = self.samples.len() - 1;
        [place.saturating_sub(1), place.min(last)].map(|place| &self.samples[place])
    }

    /// The state at the start of the stretch. A sample has the posture of the middle of its interval; that of the start
    /// is the mean of two.
    pub(super) fn start_state(&self, motion: &Motion<f64>) -> State<f64> {
        let [before, after] = self.around(0);
        let mut state = State::from_motion(motion, before);
        let other = State::from_motion(motion, after);
        state.cg_position = mean(&state.cg_position, &other.cg_position);
        state.linear_momentum = mean(&state.linear_momentum, &other.linear_momentum);
        state.angular_momentum = mean(&state.angular_momentum, &other.angular_momentum);
        state
    }

    /// The motion at the end of an interval, likewise.
    pub(super) fn end_motion(&self, state: &State<f64>, end: usize) -> Motion<f64> {
        let [before, after] = self.around(end);
        let mut motion = state.motion(before);
        let other = state.motion(after);
        motion.position = mean(&motion.position, &other.position);
        motion.velocity = mean(&motion.velocity, &other.velocity);
        motion.angular_velocity = mean(&motion.angular_velocity, &other.angular_velocity);
        motion
    }
}

fn mean<F>(a: &Vector<f64, F>, b: &Vector<f64, F>) -> Vector<f64, F> {
    Vector::from_components((a.components + b.components) * 0.5)
}

/// Position of an interval's end within the stretch, from -1 to 1. The first `margin` ends are before it.
fn over_stretch(k: usize, margin: usize, count: usize) -> f64 {
    2.0 * (k as f64 - margin as f64) / count as f64 - 1.0
}

/// Samples the loads and mass properties that depend only on the postures.
fn sampled(model: &Model<f64>, postures: &[Posed]) -> Rc<[PostureSample<f64>]> {
    let sample = |(posture, rate): &Posed| model.dynamics.sample(posture, rate);
    postures.iter().map(sample).collect()
}
