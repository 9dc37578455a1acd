//! Short simulations along the recorded postures, and their residuals.
//!
//! The flight is cut into stretches. In each, the model flies freely from the smoothed measurement at its start, so its
//! loads do not depend on sensor noise; the error of the start is one of the modelled errors. Nothing is
//! differentiated. Attitude, angular velocity and velocity are compared as averages over a tenth of a second, in which
//! errors of sensors and errors of physics leave different patterns.

use core::ops::RangeInclusive;

use bodyflight_core::dynamics::Motion;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::small_rotation;
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};

use super::track::Track;

/// Channels of a comparison: attitude (body axes), angular velocity (body), velocity (north, west, up).
pub const CHANNELS: usize = 9;
/// Comparisons in a stretch, a tenth of a second each.
pub const ROWS: usize = 6;
/// Number of residuals in a stretch.
pub const NUMBERS: usize = ROWS * CHANNELS;
/// Length of a comparison window (s).
const WINDOW: f64 = 0.1;
/// Longest integration step for simulations used in differences (s), and for simulations backwards in time.
const LONG_STEP: f64 = 0.05;
const BACK_STEP: f64 = 0.03;
/// Largest rotation in such a step (rad). The error of a slope grows with its square: 4 % at this rotation, and without
/// limit above 0.8 rad, where the integration is unstable.
const STEP_TURN: f64 = 0.25;
/// Longest integration step for simulations compared with the measurement (s).
const SHORT_STEP: f64 = 1.0 / 239.0;
/// Comparison windows before the first stretch, enough for a plausible delay.
const BEFORE: usize = 4;
/// Times on either side of the start that are used for smoothing (s), the longest for which a parabola is adequate: the
/// body turns by at most this angle (rad), and the squared residuals of the angular velocity exceed those of its noise
/// by at most this many standard deviations.
const SMOOTHED: [f64; 4] = [0.1, 0.07, 0.05, 0.035];
const SMOOTHED_TURN: f64 = 0.7;
const SMOOTHED_EXCESS: f64 = 2.0;

/// A difference in all channels.
pub type Channels = SVector<f64, CHANNELS>;

/// How a recording is cut into frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Number of frames in a comparison window.
    pub window: usize,
    /// Number of frames in a long step.
    pub stride: usize,
    /// Number of frames in a step backwards.
    pub back: usize,
    /// Number of short steps in a frame.
    pub parts: usize,
}

impl Grid {
    /// The grid for a frame rate (Hz) and the fastest rotation (rad/s).
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rates are positive and small"
    )]
    pub fn new(rate: f64, turning: f64) -> Self {
        let window = (rate * WINDOW).round().max(1.0) as usize;
        let stride = |longest: f64| {
            let longest = longest.min(STEP_TURN / turning.max(1e-6));
            let longest = ((rate * longest) as usize).max(1);
            let mut strides = (1..=longest.min(window)).rev();
            let even = strides.find(|stride| window.is_multiple_of(*stride));
            even.unwrap_or(1)
        };
        Self {
            window,
            stride: stride(LONG_STEP),
            back: stride(BACK_STEP),
            parts: (1.0 / (rate * SHORT_STEP)).ceil().max(1.0) as usize,
        }
    }

    /// Number of frames in a stretch.
    pub fn frames(&self) -> usize {
        ROWS * self.window
    }
}

/// A stretch of a flight.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Index of its first frame.
    pub first: usize,
    /// Its grid.
    pub grid: Grid,
    /// The smoothed motion at its start.
    pub start: Motion<f64>,
    /// Variance of the start for unit variance of a frame.
    pub start_variance: f64,
    /// Covariance of the start with the first comparison for unit variance of a frame.
    pub start_covariance: f64,
}

/// The first frame of each stretch of a track.
pub fn first_frames(track: &Track) -> impl Iterator<Item = usize> {
    let grid = Grid::new(track.rate(), 0.0);
    let ends = track
        .measured
        .len()
        .saturating_sub(grid.frames() + grid.window);
    (BEFORE * grid.window..ends).step_by(grid.frames())
}

/// Cuts a track into stretches. `noise` is that of the angular velocity (rad/s).
pub fn stretches(track: &Track, noise: f64) -> Vec<Stretch> {
    let stretch = |first: usize| {
        let grid = Grid::new(track.rate(), turning(track, first));
        let smooth = Smooth::new(track, grid, first, noise);
        Stretch {
            first,
            grid,
            start: smooth.motion,
            start_variance: smooth.variance,
            start_covariance: smooth.after / grid.window as f64,
        }
    };
    first_frames(track).map(stretch).collect()
}

/// The fastest rotation (rad/s) in a stretch, averaged over a window, so that a single wrong frame does not count.
fn turning(track: &Track, first: usize) -> f64 {
    let grid = Grid::new(track.rate(), 0.0);
    let mean = |window: &[Motion<f64>]| {
        let rates = window
            .iter()
            .map(|motion| motion.angular_velocity.components.norm());
        rates.sum::<f64>() / window.len() as f64
    };
    let frames = &track.measured[first..first + grid.frames()];
    frames.chunks(grid.window).map(mean).fold(0.0, f64::max)
}

/// A smoothed motion.
struct Smooth {
    motion: Motion<f64>,
    /// Sum of the squares of the weights.
    variance: f64,
    /// Sum of the weights after the frame.
    after: f64,
}

impl Smooth {
    /// Fits a parabola through the neighbouring frames, over the longest time for which it is adequate. `noise` is that of
    /// the angular velocity (rad/s).
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "only a few frames"
    )]
    fn new(track: &Track, grid: Grid, frame: usize, noise: f64) -> Self {
        let turn = track.measured[frame].angular_velocity.components.norm();
        let around = |longest: f64| {
            let side = longest.min(SMOOTHED_TURN / turn.max(1e-6));
            let frames = (side * track.rate()).round() as usize;
            let half = frames.clamp(2, grid.window.max(2));
            let last = (frame + half).min(track.measured.len() - 1);
            Parabola::new(frame, frame.saturating_sub(half)..=last)
        };
        let [others @ .., shortest] = SMOOTHED;
        let mut longer = others.into_iter().map(around);
        let adequate = longer.find(|parabola| parabola.is_adequate(track, noise));
        let parabola = adequate.unwrap_or_else(|| around(shortest));
        let (from, to) = (*parabola.frames.start(), *parabola.frames.end());
        // The value of the parabola at the start.
        let weight = |k: usize| parabola.inverse.column(0).dot(&powers(k, frame));
        let centre = track.measured[frame];
        let mut mean = Channels::zeros();
        let mut carried = UnitQuaternion::identity();
        let add = |mean: &mut Channels, k: usize, carried: &UnitQuaternion<f64>| {
            // The rotation in between is removed using the angular velocity.
            let mut motion = track.measured[k];
            let velocity = motion.velocity_inertial();
            motion.inertial_from_body =
                Rotation::from_quaternion(motion.inertial_from_body.quaternion() * carried);
            motion.velocity = motion.inertial_from_body.inverse() * velocity;
            *mean += difference(&motion, &centre) * weight(k);
        };
        add(&mut mean, frame, &carried);
        for k in frame + 1..=to {
            carried = turned(track, k - 1, k).inverse() * carried;
            add(&mut mean, k, &carried);
        }
        carried = UnitQuaternion::identity();
        for k in (from..frame).rev() {
            carried = turned(track, k, k + 1) * carried;
            add(&mut mean, k, &carried);
        }
        Self {
            motion: moved(&centre, &mean),
            variance: (from..=to).map(|k| weight(k).powi(2)).sum(),
            after: (frame + 1..=to).map(weight).sum(),
        }
    }
}

/// A parabola through the frames around a start, by least squares (Savitzky-Golay filter).
struct Parabola {
    start: usize,
    frames: RangeInclusive<usize>,
    /// Inverse of the matrix of moments.
    inverse: Matrix3<f64>,
}

impl Parabola {
    fn new(start: usize, frames: RangeInclusive<usize>) -> Self {
        let powers = frames.clone().map(|k| powers(k, start));
        let moments: Matrix3<f64> = powers.map(|powers| powers * powers.transpose()).sum();
        // With fewer than three frames, their mean has to do.
        let mean = || Matrix3::from_partial_diagonal(&[1.0 / moments[(0, 0)]]);
        Self {
            start,
            frames,
            inverse: moments.try_inverse().unwrap_or_else(mean),
        }
    }

    /// Whether what it leaves of the angular velocity is no more than its noise (rad/s).
    fn is_adequate(&self, track: &Track, noise: f64) -> bool {
        let spin = |k: usize| track.measured[k].angular_velocity.components;
        let each = || {
            self.frames
                .clone()
                .map(|k| (powers(k, self.start), spin(k)))
        };
        let sums: Matrix3<f64> = each().map(|(powers, spin)| powers * spin.transpose()).sum();
        let fitted = self.inverse * sums;
        let left = each().map(|(powers, spin)| (spin - fitted.tr_mul(&powers)).norm_squared());
        let freedom = 3.0 * (self.frames.clone().count() as f64 - 3.0);
        left.sum::<f64>() / noise.powi(2) <= freedom + SMOOTHED_EXCESS * (2.0 * freedom).sqrt()
    }
}

/// One, the number of frames after the start, and its square.
fn powers(frame: usize, start: usize) -> Vector3<f64> {
    let offset = frame as f64 - start as f64;
    Vector3::new(1.0, offset, offset.powi(2))
}

/// The rotation between two neighbouring frames according to the angular velocity.
fn turned(track: &Track, from: usize, to: usize) -> UnitQuaternion<f64> {
    let spin = |k: usize| track.measured[k].angular_velocity.components;
    let duration = track.times[to] - track.times[from];
    UnitQuaternion::from_scaled_axis((spin(from) + spin(to)) * (0.5 * duration))
}

/// Adds a difference in all channels to a motion.
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

/// Difference `measured` less `predicted`.
pub(super) fn difference(measured: &Motion<f64>, predicted: &Motion<f64>) -> Channels {
    let turn = predicted.inertial_from_body.quaternion().inverse()
        * measured.inertial_from_body.quaternion();
    let attitude = turn.scaled_axis();
    let spin = measured.angular_velocity.components - predicted.angular_velocity.components;
    let velocity =
        measured.velocity_inertial().components - predicted.velocity_inertial().components;
    Channels::from_iterator(attitude.iter().chain(&spin).chain(&velocity).copied())
}
