//! A recording in blocks of frames: what is in the air in each, so that memory does not grow with its length.

use bodyflight_core::air::GRAVITY;
use bodyflight_core::dynamics::{Dynamics, Inputs, State};
use bodyflight_core::frame::Vector;
use bodyflight_io::diagnostic::Result;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::recorded::Recorded;
use nalgebra::{UnitQuaternion, Vector3};

use super::physics::{self, Fall, Momentum};
use super::{phases, steps};

/// Length of a block (s), and what is kept of it for the next (s): a part at its end may go on.
const BLOCK: f64 = 60.0;
const KEPT: f64 = 2.0;
/// A part that ends so close to the end of a block (s) may go on in the next.
const OPEN: f64 = 0.5;
/// Fewest frames of a block: gaps may be long.
const FEWEST: usize = 1000;
/// Most heights that are kept for the figure.
const MOST_HEIGHTS: usize = 40_000;
/// A part in which gravity is off by more than this, and the angular momentum changes by more than these (percent,
/// kg m2/s), is not in the air: something touches the body.
const TOUCHED: f64 = 0.1;
const TOUCHED_DRIFT: f64 = 40.0;
const TOUCHED_DRIFT_NMS: f64 = 3.0;
/// Shortest part of which gravity alone is believed (s).
const SHORT: f64 = 0.25;

/// A part in which nothing touches the body, with its frames.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its begin (s since frame 0).
    pub begin_s: f64,
    /// Its length (s).
    pub length_s: f64,
    /// The fall of the centre of mass.
    pub fall: Fall,
    /// The angular momentum about the centre of mass.
    pub momentum: Momentum,
    /// Its frames.
    pub recorded: Recorded,
}

/// Height of the centre of mass (m) over time (s), thinned out in long recordings.
#[derive(Debug, Clone, Default)]
pub(super) struct Heights {
    pub(super) points: Vec<(f64, f64)>,
    every: usize,
    skipped: usize,
}

impl Heights {
    fn see(&mut self, time: f64, height: f64) {
        self.skipped += 1;
        if self.skipped < self.every {
            return;
        }
        self.skipped = 0;
        self.points.push((time, height));
        if self.points.len() > MOST_HEIGHTS {
            self.points = self.points.iter().copied().step_by(2).collect();
            self.every = 2 * self.every.max(1);
        }
    }
}

/// What has been read so far.
pub(super) struct Blocks {
    dynamics: Dynamics<f64>,
    inputs: Inputs<f64>,
    /// Acceleration near which phases are looked for (m/s2).
    gravity: f64,
    /// Frames that have not been judged yet, after those that are kept from the last block.
    frames: Vec<FlightFrame>,
    /// Time until which everything has been judged (s).
    judged_until: f64,
    pub(super) seen: u64,
    pub(super) parts: Vec<Part>,
    pub(super) steps: Vec<steps::Step>,
    pub(super) heights: Heights,
}

impl Blocks {
    pub(super) fn new(dynamics: Dynamics<f64>, inputs: Inputs<f64>, gravity: f64) -> Self {
        Self {
            dynamics,
            inputs,
            gravity,
            frames: Vec::new(),
            judged_until: f64::NEG_INFINITY,
            seen: 0,
            parts: Vec::new(),
            steps: Vec::new(),
            heights: Heights::default(),
        }
    }

    /// Takes the next frame.
    pub(super) fn see(&mut self, frame: FlightFrame) -> Result<()> {
        self.seen += 1;
        self.frames.push(frame);
        let begin = self.frames.first().map_or(0.0, |first| first.time);
        if self.frames.len() > FEWEST && frame.time - begin > BLOCK {
            // The difference at the last frame needs the next one.
            let Some(last) = self.frames.pop() else {
                return Ok(());
            };
            fill_rates(&mut self.frames, Some(&last));
            let kept = self.judge(false)?;
            self.frames.drain(..kept);
            self.frames.push(last);
        }
        Ok(())
    }

    /// Judges what is left.
    pub(super) fn end(&mut self) -> Result<()> {
        fill_rates(&mut self.frames, None);
        self.judge(true)?;
        self.frames = Vec::new();
        Ok(())
    }

    /// Judges the frames, and returns the first that the next block needs.
    fn judge(&mut self, is_last: bool) -> Result<usize> {
        let recorded = Recorded::new(&self.frames, self.dynamics, self.inputs)?;
        let states = states(&recorded);
        let times: Vec<f64> = recorded.samples.iter().map(|sample| sample.time).collect();
        let centres: Vec<Vector3<f64>> = (states.iter())
            .map(|state| state.cg_position.components)
            .collect();
        let end = times.last().copied().unwrap_or(0.0);
        let mut next = if is_last {
            times.len()
        } else {
            times.partition_point(|time| *time < end - KEPT)
        };
        for [first, last] in phases::found(&times, &centres, self.gravity) {
            if !is_last && times[last] > end - OPEN {
                let before = times[first] - OPEN;
                next = next.min(times.partition_point(|time| *time < before));
                break;
            }
            next = next.max(last + 1);
            let range = first..=last;
            let Some(fall) = physics::fall(&times[range.clone()], &centres[range.clone()]) else {
                continue;
            };
            let momenta: Vec<Vector3<f64>> = (states[range.clone()].iter())
                .map(|state| state.angular_momentum.components)
                .collect();
            let momentum = physics::momentum(&times[range.clone()], &momenta);
            if is_touched(&fall, &momentum, times[last] - times[first]) {
                continue;
            }
            self.parts.push(Part {
                begin_s: times[first],
                length_s: times[last] - times[first],
                fall,
                momentum,
                recorded: Recorded::new(&self.frames[range], self.dynamics, self.inputs)?,
            });
        }
        let until = if is_last {
            f64::INFINITY
        } else {
            times.get(next).copied().unwrap_or(end)
        };
        let is_new = |time: f64| time >= self.judged_until && time < until;
        let found = steps::found(&self.frames);
        self.steps
            .extend(found.into_iter().filter(|step| is_new(step.time)));
        for (time, centre) in times.iter().zip(&centres) {
            if is_new(*time) {
                self.heights.see(*time, centre.z);
            }
        }
        self.judged_until = until;
        // A part that fills the whole block is judged in pieces.
        Ok(if next == 0 { times.len() } else { next })
    }
}

/// Position, momentum and angular momentum of the whole body in each frame.
pub(super) fn states(recorded: &Recorded) -> Vec<State<f64>> {
    let frames = 0..recorded.samples.len();
    frames
        .map(|frame| {
            let rate = recorded.rate(frame);
            let sample = recorded
                .dynamics
                .sample(&recorded.samples[frame].posture, &rate);
            State::from_motion(&recorded.samples[frame].motion, &sample)
        })
        .collect()
}

/// Fills in velocities and angular velocities that the file lacks: central differences. At the ends, those with a frame
/// that follows, or one-sided ones.
fn fill_rates(frames: &mut [FlightFrame], next: Option<&FlightFrame>) {
    let places: Vec<(f64, Vector3<f64>, UnitQuaternion<f64>)> = (frames.iter().chain(next))
        .map(|frame| {
            let pelvis = &frame.pelvis;
            let attitude = *pelvis.inertial_from_body.quaternion();
            (frame.time, pelvis.position.components, attitude)
        })
        .collect();
    for (k, frame) in frames.iter_mut().enumerate() {
        let (before, from, attitude) = &places[k.saturating_sub(1)];
        let (after, to, next) = &places[(k + 1).min(places.len() - 1)];
        let duration = after - before;
        let turn: UnitQuaternion<f64> = next * attitude.inverse();
        let pelvis = &mut frame.pelvis;
        let velocity = Vector::from_components((to - from) / duration);
        pelvis.velocity.get_or_insert(velocity);
        let spin = Vector::from_components(turn.scaled_axis() / duration);
        pelvis.angular_velocity.get_or_insert(spin);
    }
}

/// Whether neither gravity nor the angular momentum is what it must be: a wrong rate or scale leaves the angular momentum
/// constant. A short part with a gravity that is wrong beyond its error is a swing or a push.
fn is_touched(fall: &Fall, momentum: &Momentum, length: f64) -> bool {
    let off = (fall.g_mps2 - GRAVITY).abs();
    let is_swing = length < SHORT && off > (3.0 * fall.standard_error_mps2).max(TOUCHED * GRAVITY);
    is_swing
        || off > TOUCHED * GRAVITY
            && momentum.drift_nms > TOUCHED_DRIFT_NMS
            && momentum
                .drift_percent
                .is_none_or(|drift| drift > TOUCHED_DRIFT)
}
