//! A flight in memory.

use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};
use bodyflight_core::{Posture, Segment};
use nalgebra::Vector3;

/// Root mean square of joint angles and of the direction of the stream below which a flight counts as motionless (rad):
/// the jitter of suit and sensors.
const STILL: f64 = 0.04;

/// A recorded flight with its model.
#[derive(Debug, Clone)]
pub struct Track {
    /// Time of each frame (s).
    pub times: Vec<f64>,
    /// Recorded postures.
    pub postures: Vec<Posture<f64>>,
    /// Recorded motion of the pelvis.
    pub measured: Vec<Motion<f64>>,
    /// The model as given by the files.
    pub dynamics: Dynamics<f64>,
    /// The skydiver's inputs halfway from each frame to the next, as given by the files.
    pub inputs: Vec<Inputs<f64>>,
}

/// One instant of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Time (s).
    pub time: f64,
    /// Recorded posture.
    pub posture: Posture<f64>,
    /// Recorded motion of the pelvis.
    pub motion: Motion<f64>,
}

impl Track {
    /// Creates a flight; `inputs` returns the skydiver's inputs at a time (s).
    pub fn new(
        frames: &[Frame],
        dynamics: Dynamics<f64>,
        inputs: impl Fn(f64) -> Inputs<f64>,
    ) -> Self {
        let next = frames.iter().skip(1).chain(frames.last());
        let middles = frames.iter().zip(next);
        let middles = middles.map(|(frame, next)| 0.5 * (frame.time + next.time));
        Self {
            inputs: middles.map(inputs).collect(),
            times: frames.iter().map(|frame| frame.time).collect(),
            postures: frames.iter().map(|frame| frame.posture).collect(),
            measured: frames.iter().map(|frame| frame.motion).collect(),
            dynamics,
        }
    }

    /// Frame rate (Hz).
    pub fn rate(&self) -> f64 {
        (self.times.len().max(2) - 1) as f64 / self.duration().max(1e-6)
    }

    /// Duration (s).
    pub fn duration(&self) -> f64 {
        let ends = self.times.first().zip(self.times.last());
        ends.map_or(0.0, |(first, last)| last - first)
    }

    /// Whether one posture is held at one attitude to the stream. Many effects then amount to one constant force and
    /// moment, and cannot be separated however long the flight is.
    pub fn is_still(&self) -> bool {
        let (Some(first), count) = (self.postures.first(), self.postures.len().max(1) as f64)
        else {
            return true;
        };
        let moved = |posture: &Posture<f64>| {
            let joints = Segment::ALL.iter().skip(1).map(|&segment| {
                let from = first.parent_from_segment(segment);
                from.angle_to(posture.parent_from_segment(segment)).powi(2)
            });
            joints.sum::<f64>() / (Segment::ALL.len() - 1) as f64
        };
        let joints = self.postures.iter().map(moved).sum::<f64>() / count;
        let stream = |motion: &Motion<f64>| {
            let through_air = motion.velocity.components;
            through_air / through_air.norm().max(1.0)
        };
        let mean = self
            .measured
            .iter()
            .fold(Vector3::zeros(), |sum, motion| sum + stream(motion))
            / count;
        let aside = |motion: &Motion<f64>| (stream(motion) - mean).norm_squared();
        let attitude = self.measured.iter().map(aside).sum::<f64>() / count;
        joints.sqrt() < STILL && attitude.sqrt() < STILL
    }

    /// Height of the first frame (m, inertial).
    pub fn start_height(&self) -> f64 {
        self.measured
            .first()
            .map_or(0.0, |motion| motion.position.components.z)
    }
}
