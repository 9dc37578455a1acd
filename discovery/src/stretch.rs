//! Short free runs over the recorded postures, and how far the measurement is from them.
//!
//! The flight is cut into stretches. In each, the model flies alone from the smoothed measurement at its start, so
//! what it feels does not depend on the noise of the sensors; the error of the start is left free within what
//! smoothing leaves. Nothing is differentiated. Averages over a tenth of a second are compared: attitude, angular
//! velocity and velocity, so that errors of the sensors and of the physics show in different rows.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::small_rotation;
use bodyflight_core::sensor_noise::SensorNoise;
use nalgebra::{DVector, SVector, Vector3};

use super::track::Track;

/// Frames of a stretch: 0.6 s at 240 Hz, short enough for what joints have wrong to act in proportion.
pub const FRAMES: usize = 144;
/// Frames that are averaged into a row of comparisons.
pub const WINDOW: usize = 24;
/// Channels of a comparison: attitude (body axes), angular velocity (body), velocity (north, west, up).
pub const CHANNELS: usize = 9;
/// Comparisons of a stretch.
const ROWS: usize = FRAMES / WINDOW;
/// Numbers of a stretch.
pub const NUMBERS: usize = ROWS * CHANNELS;
/// Frames on both sides of the start that are smoothed.
const HALF_SMOOTHING: usize = 12;
/// Frames between the moments around the start at which the motion is kept, for sensors that are late.
const APART: usize = 24;
/// Moments on either side of the start: as far as a plausible delay reaches.
pub(super) const SIDE: usize = 3;
/// Standard deviations of single frames: attitude (rad), angular velocity (rad/s), velocity (m/s), the paper's.
pub const SENSOR_NOISE: [f64; CHANNELS] = {
    let SensorNoise {
        attitude,
        angular_velocity: spin,
        horizontal_velocity: horizontal,
        vertical_velocity: vertical,
        ..
    } = SensorNoise::PAPER;
    [
        attitude, attitude, attitude, spin, spin, spin, horizontal, horizontal, vertical,
    ]
};

/// What the model misses in a tenth of a second whatever it knows: jitter of joints, slow errors of the suit.
const MODEL_NOISE: [f64; CHANNELS] = [
    0.0005, 0.0005, 0.0005, 0.0025, 0.0025, 0.0025, 0.006, 0.006, 0.01,
];

/// A difference in all channels.
pub type Channels = SVector<f64, CHANNELS>;

/// A stretch of a flight.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Its first frame.
    pub first: usize,
    /// The smoothed motion there.
    pub start: Motion<f64>,
    /// How the motion goes on around the start.
    pub(super) course: Course,
}

/// Velocity and angular velocity measured around a moment, every [`APART`] frames.
#[derive(Debug, Clone)]
pub(super) struct Course {
    moments: [SVector<f64, 6>; 2 * SIDE + 1],
    /// Time between two moments (s).
    pub(super) apart: f64,
}

impl Course {
    /// What changes until `later` (s) than the moment, by a cubic through the moments.
    pub(super) fn change(&self, later: f64) -> SVector<f64, 6> {
        let last = 2 * SIDE;
        let place = (later / self.apart + SIDE as f64).clamp(0.0, last as f64);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few moments"
        )]
        let from = (place as usize).min(last - 1);
        let share = place - from as f64;
        let at = |k: usize| self.moments[k.min(last)];
        let (left, right) = (at(from), at(from + 1));
        let slope_left = (right - at(from.saturating_sub(1))) * 0.5;
        let slope_right = (at(from + 2) - left) * 0.5;
        let (square, cube) = (share * share, share.powi(3));
        let curve = (right - left) * (3.0 * square - 2.0 * cube)
            + slope_left * (cube - 2.0 * square + share)
            + slope_right * (cube - square);
        left + curve - self.moments[SIDE]
    }
}

/// Where stretches begin, and from which motion.
pub fn stretches(track: &Track) -> Vec<Stretch> {
    let count = track.measured.len();
    let reach = SIDE * APART + HALF_SMOOTHING;
    let mut first = reach;
    let mut stretches = Vec::new();
    while first + FRAMES.max(reach) < count {
        let moments = core::array::from_fn(|k| {
            six(&Moving::of(&smoothed(
                track,
                first + k * APART - SIDE * APART,
            )))
        });
        stretches.push(Stretch {
            first,
            start: smoothed(track, first),
            course: Course {
                moments,
                apart: (track.times[first + APART] - track.times[first - APART]) * 0.5,
            },
        });
        first += FRAMES;
    }
    stretches
}

/// Mean of the motions around a frame, which keeps what changes linearly.
fn smoothed(track: &Track, frame: usize) -> Motion<f64> {
    let around = frame - HALF_SMOOTHING..=frame + HALF_SMOOTHING;
    let centre = track.measured[frame];
    let share = 1.0 / (2 * HALF_SMOOTHING + 1) as f64;
    let mut mean = Channels::zeros();
    for motion in &track.measured[around] {
        mean += difference(motion, &centre) * share;
    }
    moved(&centre, &mean)
}

/// `motion` changed by a difference in all channels.
pub(super) fn moved(motion: &Motion<f64>, by: &Channels) -> Motion<f64> {
    let part = |from: usize| Vector3::new(by[from], by[from + 1], by[from + 2]);
    let turn = small_rotation(&part(0));
    let inertial_from_body =
        Rotation::from_quaternion(motion.inertial_from_body.quaternion() * turn);
    let velocity = motion.velocity_inertial().components + part(6);
    Motion {
        inertial_from_body,
        position: motion.position,
        velocity: inertial_from_body.inverse() * Vector::from_components(velocity),
        angular_velocity: Vector::from_components(motion.angular_velocity.components + part(3)),
    }
}

/// `measured` less `predicted`.
pub(super) fn difference(measured: &Motion<f64>, predicted: &Motion<f64>) -> Channels {
    let turn = predicted.inertial_from_body.quaternion().inverse()
        * measured.inertial_from_body.quaternion();
    let attitude = turn.scaled_axis();
    let spin = measured.angular_velocity.components - predicted.angular_velocity.components;
    let velocity =
        measured.velocity_inertial().components - predicted.velocity_inertial().components;
    Channels::from_iterator(attitude.iter().chain(&spin).chain(&velocity).copied())
}

/// Covariance of the start, by its standard deviations.
pub fn start_deviation() -> Channels {
    let smoothing = 1.0 / (2.0 * HALF_SMOOTHING as f64 + 1.0).sqrt();
    Channels::from_fn(|channel, _| SENSOR_NOISE[channel] * smoothing * 1.2)
}

/// Variance of the numbers of a stretch.
pub fn variance() -> DVector<f64> {
    let averaged = WINDOW as f64;
    DVector::from_fn(NUMBERS, |row, _| {
        let channel = row % CHANNELS;
        SENSOR_NOISE[channel].powi(2) / averaged + MODEL_NOISE[channel].powi(2)
    })
}

pub(super) fn six(moving: &Moving<f64>) -> SVector<f64, 6> {
    let (velocity, spin) = (
        &moving.velocity.components,
        &moving.angular_velocity.components,
    );
    SVector::from_iterator(velocity.iter().chain(spin).copied())
}

pub(super) fn moving(six: &SVector<f64, 6>) -> Moving<f64> {
    Moving {
        velocity: Vector::new(six[0], six[1], six[2]),
        angular_velocity: Vector::new(six[3], six[4], six[5]),
    }
}
