//! A flight in memory.

use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::{Posture, Segment};
use core::ops::Range;

use nalgebra::Vector3;

/// Largest difference of the frame rates of flights that are joined.
const SAME_RATE: f64 = 0.01;

/// A recorded flight with its model.
#[derive(Debug, Clone)]
pub struct RecordedFlight {
    /// Its frames.
    pub samples: Vec<FlightSample>,
    /// The model as given by the files.
    pub dynamics: Dynamics<f64>,
    /// The skydiver's inputs halfway from each frame to the next, as given by the files.
    pub inputs: Vec<Inputs<f64>>,
    /// Frames of each piece without a break. A single flight is one piece.
    pub(crate) pieces: Vec<Range<usize>>,
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
            pieces: core::iter::once(0..frames.len()).collect(),
        }
    }

    /// Joins another flight of the same body with the same suit, after a pause of one frame. Returns `false` and leaves
    /// this one as it is if rates or models differ.
    pub(crate) fn join(&mut self, next: &Self) -> bool {
        let is_alike = (next.rate() / self.rate() - 1.0).abs() < SAME_RATE;
        let (Some(last), Some(first)) = (self.samples.last(), next.samples.first()) else {
            return false;
        };
        if !is_alike || self.dynamics != next.dynamics {
            return false;
        }
        let later = last.time + 1.0 / self.rate() - first.time;
        let begin = self.samples.len();
        self.samples
            .extend(next.samples.iter().map(|sample| FlightSample {
                time: sample.time + later,
                ..*sample
            }));
        self.inputs.extend(&next.inputs);
        let pieces = next.pieces.iter();
        let moved = pieces.map(|piece| begin + piece.start..begin + piece.end);
        self.pieces.extend(moved);
        true
    }

    /// Frame rate (Hz).
    pub fn rate(&self) -> f64 {
        let intervals = self.pieces.iter().map(|piece| piece.len().max(1) - 1);
        intervals.sum::<usize>().max(1) as f64 / self.duration().max(1e-6)
    }

    /// Duration (s), without the pauses between pieces.
    pub fn duration(&self) -> f64 {
        let of = |piece: &Range<usize>| {
            let samples = self.samples.get(piece.clone()).unwrap_or(&[]);
            let ends = samples.first().zip(samples.last());
            ends.map_or(0.0, |(first, last)| last.time - first.time)
        };
        self.pieces.iter().map(of).sum()
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

    /// The recorded posture at a fractional frame index within a piece, for a recording that lags by `delay` (s).
    pub(crate) fn posture_at(&self, place: f64, delay: f64, piece: &Range<usize>) -> Posture<f64> {
        let (first, last) = (piece.start, piece.end - 1);
        let interval = (self.samples[last].time - self.samples[first].time) / (last - first) as f64;
        let place = (place + delay / interval).clamp(first as f64, last as f64);
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
