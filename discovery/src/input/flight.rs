//! A flight in memory.

use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::{Posture, Segment};
use nalgebra::Vector3;

/// A recorded flight with its model.
#[derive(Debug, Clone)]
pub struct RecordedFlight {
    /// Its frames.
    pub samples: Vec<FlightSample>,
    /// The model as given by the files.
    pub dynamics: Dynamics<f64>,
    /// The skydiver's inputs halfway from each frame to the next, as given by the files.
    pub inputs: Vec<Inputs<f64>>,
}

impl RecordedFlight {
    /// Creates a flight; `inputs` returns the skydiver's inputs at a time (s).
    pub fn new(
        frames: &[FlightSample],
        dynamics: Dynamics<f64>,
        inputs: impl Fn(f64) -> Inputs<f64>,
    ) -> Self {
        let next = frames.iter().skip(1).chain(frames.last());
        let middles = frames.iter().zip(next);
        let middles = middles.map(|(frame, next)| 0.5 * (frame.time + next.time));
        Self {
            inputs: middles.map(inputs).collect(),
            samples: frames.to_vec(),
            dynamics,
        }
    }

    /// Frame rate (Hz).
    pub fn rate(&self) -> f64 {
        (self.samples.len().max(2) - 1) as f64 / self.duration().max(1e-6)
    }

    /// Duration (s).
    pub fn duration(&self) -> f64 {
        let ends = self.samples.first().zip(self.samples.last());
        ends.map_or(0.0, |(first, last)| last.time - first.time)
    }

    /// Whether one posture is held at one attitude to the stream. Many effects then amount to one constant force and
    /// moment, and cannot be separated however long the flight is.
    ///
    /// `jitter` is the root mean square of joint angles and of the direction of the stream below which neither moves (rad).
    pub fn is_still(&self, jitter: f64) -> bool {
        let (Some(first), count) = (self.samples.first(), self.samples.len().max(1) as f64) else {
            return true;
        };
        let moved = |sample: &FlightSample| {
            let joints = Segment::ALL.iter().skip(1).map(|&segment| {
                let from = first.posture.parent_from_segment(segment);
                let to = sample.posture.parent_from_segment(segment);
                from.angle_to(to).powi(2)
            });
            joints.sum::<f64>() / (Segment::ALL.len() - 1) as f64
        };
        let joints = self.samples.iter().map(moved).sum::<f64>() / count;
        let stream = |sample: &FlightSample| {
            let through_air = sample.motion.velocity.components;
            through_air / through_air.norm().max(1.0)
        };
        let mean = self
            .samples
            .iter()
            .fold(Vector3::zeros(), |sum, sample| sum + stream(sample))
            / count;
        let aside = |sample: &FlightSample| (stream(sample) - mean).norm_squared();
        let attitude = self.samples.iter().map(aside).sum::<f64>() / count;
        joints.sqrt() < jitter && attitude.sqrt() < jitter
    }

    /// Height of the first frame (m, inertial).
    pub fn start_height(&self) -> f64 {
        self.samples
            .first()
            .map_or(0.0, |sample| sample.motion.position.components.z)
    }

    /// The recorded posture at a fractional frame index, for a recording that lags by `delay` (s).
    pub(crate) fn posture_at(&self, place: f64, delay: f64) -> Posture<f64> {
        let last = self.samples.len() - 1;
        let interval = self.duration() / last as f64;
        let place = (place + delay / interval).clamp(0.0, last as f64);
        let before = place.floor();
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "clamped to the frames"
        )]
        let index = before as usize;
        if place <= before {
            return self.samples[index].posture;
        }
        self.samples[index]
            .posture
            .interpolated(&self.samples[(index + 1).min(last)].posture, place - before)
    }
}
