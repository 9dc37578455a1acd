//! The stretches of a flight, and differences in all channels.
//!
//! The flight is cut into stretches. In each, the model flies freely from the smoothed measurement at its start, so its
//! loads do not depend on sensor noise; the error of the start is one of the modelled errors. Nothing is
//! differentiated. Attitude, angular velocity and velocity are compared as averages over a tenth of a second, in which
//! errors of sensors and errors of physics leave different patterns.

use core::ops::Range;

use bodyflight_core::dynamics::Motion;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::math::small_rotation;
use nalgebra::{SVector, Vector3};

/// Channels of a comparison: attitude (body axes), angular velocity (body), velocity (north, west, up).
pub const CHANNELS: usize = 9;
/// Most comparisons in a stretch, a tenth of a second each. The last stretch of a short flight has fewer.
pub(crate) const ROWS: usize = 6;
/// Length of a comparison window (s).
pub(crate) const WINDOW: f64 = 0.1;
/// Longest integration step for simulations used in differences (s), and for simulations backwards in time.
const LONG_STEP: f64 = 0.05;
const BACK_STEP: f64 = 0.03;
/// Largest rotation in such a step (rad). The error of a slope grows with its square: 4 % at this rotation, and without
/// limit above 0.8 rad, where the integration is unstable.
const STEP_TURN: f64 = 0.25;
/// Longest integration step for simulations compared with the measurement (s).
const SHORT_STEP: f64 = 1.0 / 239.0;
/// A difference in all channels.
pub(crate) type Channels = SVector<f64, CHANNELS>;

/// How a recording is cut into frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grid {
    /// Number of comparisons.
    pub rows: usize,
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
    /// The grid for a number of comparisons, a frame rate (Hz) and the fastest rotation (rad/s).
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "rates are positive and small"
    )]
    pub fn new(rows: usize, rate: f64, turning: f64) -> Self {
        let window = (rate * WINDOW).round().max(1.0) as usize;
        let stride = |longest: f64| {
            let longest = longest.min(STEP_TURN / turning.max(1e-6));
            let longest = ((rate * longest) as usize).max(1);
            let mut strides = (1..=longest.min(window)).rev();
            let even = strides.find(|stride| window.is_multiple_of(*stride));
            even.unwrap_or(1)
        };
        Self {
            rows,
            window,
            stride: stride(LONG_STEP),
            back: stride(BACK_STEP),
            parts: (1.0 / (rate * SHORT_STEP)).ceil().max(1.0) as usize,
        }
    }

    /// Number of frames in a stretch.
    pub fn frames(&self) -> usize {
        self.rows * self.window
    }

    /// Number of residuals in a stretch.
    pub(crate) fn residuals(&self) -> usize {
        self.rows * CHANNELS
    }
}

/// A stretch of a flight.
#[derive(Debug, Clone)]
pub struct Stretch {
    /// Index of its first frame.
    pub first: usize,
    /// The frames without a break that it belongs to.
    pub piece: Range<usize>,
    /// Its grid.
    pub grid: Grid,
    /// The smoothed motion at its start.
    pub start: Motion<f64>,
    /// Variance of the start for unit variance of a frame.
    pub start_variance: f64,
    /// Covariance of the start with the first comparison for unit variance of a frame.
    pub start_covariance: f64,
    /// Variance of the start beyond what the noise of its frames gives it, zero except in short flights.
    pub(crate) free_start: Channels,
}

/// Adds a difference in all channels to a motion.
pub(crate) fn moved(motion: &Motion<f64>, by: &Channels) -> Motion<f64> {
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
pub(crate) fn difference(measured: &Motion<f64>, predicted: &Motion<f64>) -> Channels {
    let turn = predicted.inertial_from_body.quaternion().inverse()
        * measured.inertial_from_body.quaternion();
    let attitude = turn.scaled_axis();
    let spin = measured.angular_velocity.components - predicted.angular_velocity.components;
    let velocity =
        measured.velocity_inertial().components - predicted.velocity_inertial().components;
    Channels::from_iterator(attitude.iter().chain(&spin).chain(&velocity).copied())
}
