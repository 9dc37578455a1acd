//! Cuts a flight into stretches, each with the smoothed motion at its start.

use bodyflight_core::flight_sample::FlightSample;
use core::iter::StepBy;
use core::ops::{Range, RangeInclusive};

use bodyflight_core::dynamics::Motion;
use bodyflight_core::frame::Rotation;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::input::flight::RecordedFlight;
use crate::shooting::stretch::{CHANNELS, Channels, Grid, ROWS, Stretch, difference, moved};

/// Comparison windows before the first stretch, enough for a plausible delay.
const BEFORE: usize = 4;
/// Times on either side of the start that are used for smoothing (s), the longest for which a parabola is adequate: the
/// body turns by at most this angle (rad), and the squared residuals of the angular velocity exceed those of its noise
/// by at most this many standard deviations.
const SMOOTHED: [f64; 6] = [0.1, 0.07, 0.05, 0.035, 0.025, 0.0125];
const SMOOTHED_TURN: f64 = 0.7;
const SMOOTHED_EXCESS: f64 = 2.0;

/// Standard deviations of the start of a short flight: attitude (rad), angular velocity (rad/s), velocity (m/s).
///
/// Motion capture is smoothed and moves with the skin, so the rates of its first frames are off by more than neighbouring
/// frames show: in two somersaults, such starts made three quarters of the error after a quarter of a second.
const FREE_START: [f64; CHANNELS] = [0.02, 0.02, 0.02, 0.5, 0.5, 0.5, 0.3, 0.3, 0.3];

/// Number of full stretches below which a flight is cut into shorter ones, and the least comparisons of these.
const FEW_STRETCHES: usize = 2;
const LEAST_ROWS: usize = 3;

/// First frames of the stretches of full length in so many frames.
fn full_stretches(frames: usize, grid: Grid) -> StepBy<Range<usize>> {
    let ends = frames.saturating_sub(grid.frames() + grid.window);
    (BEFORE * grid.window..ends).step_by(grid.frames())
}

/// Whether a flight is too short to estimate its errors from it alone.
pub(crate) fn is_short(track: &RecordedFlight) -> bool {
    let grid = Grid::new(ROWS, track.rate(), 0.0);
    full_stretches(track.samples.len(), grid).len() < FEW_STRETCHES
}

/// The first frame of each stretch of a piece of a track, and the number of its comparisons.
///
/// A jump of a second has no room for stretches of full length after a delay, so it is used from its first frame on,
/// in equal parts.
fn cuts(track: &RecordedFlight, piece: &Range<usize>) -> Vec<(usize, usize)> {
    let grid = Grid::new(ROWS, track.rate(), 0.0);
    let frames = piece.len();
    let full = full_stretches(frames, grid);
    if full.len() >= FEW_STRETCHES {
        return full.map(|first| (piece.start + first, ROWS)).collect();
    }
    let rows = frames.saturating_sub(1) / grid.window;
    let parts = rows.div_ceil(ROWS).max(1);
    let part = |k: usize| {
        let (from, to) = (k * rows / parts, (k + 1) * rows / parts);
        (piece.start + from * grid.window, to - from)
    };
    let short = (0..parts).map(part);
    short.filter(|(_, rows)| *rows >= LEAST_ROWS).collect()
}

/// Cuts a track into stretches. `noise` is that of the angular velocity (rad/s).
pub(crate) fn stretches(track: &RecordedFlight, noise: f64) -> Vec<Stretch> {
    let free_start = if is_short(track) {
        Channels::from(FREE_START).map(|deviation| deviation.powi(2))
    } else {
        Channels::zeros()
    };
    let stretch = |piece: &Range<usize>, (first, rows): (usize, usize)| {
        let grid = Grid::new(rows, track.rate(), turning(track, first, rows));
        let smooth = Smooth::new(track, grid, (first, piece), noise);
        Stretch {
            first,
            piece: piece.clone(),
            grid,
            start: smooth.motion,
            start_variance: smooth.variance,
            start_covariance: smooth.after / grid.window as f64,
            free_start,
        }
    };
    let of = |piece| {
        let cuts = cuts(track, piece).into_iter();
        cuts.map(move |cut| stretch(piece, cut))
    };
    track.pieces.iter().flat_map(of).collect()
}

/// The fastest rotation (rad/s) in a stretch, averaged over a window, so that a single wrong frame does not count.
fn turning(track: &RecordedFlight, first: usize, rows: usize) -> f64 {
    let grid = Grid::new(rows, track.rate(), 0.0);
    let mean = |window: &[FlightSample]| {
        let rates = window
            .iter()
            .map(|sample| sample.motion.angular_velocity.components.norm());
        rates.sum::<f64>() / window.len() as f64
    };
    let frames = &track.samples[first..first + grid.frames()];
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
    fn new(
        track: &RecordedFlight,
        grid: Grid,
        (frame, piece): (usize, &Range<usize>),
        noise: f64,
    ) -> Self {
        let turn = track.samples[frame]
            .motion
            .angular_velocity
            .components
            .norm();
        let around = |longest: f64| {
            let side = longest.min(SMOOTHED_TURN / turn.max(1e-6));
            let frames = (side * track.rate()).round() as usize;
            let half = frames.clamp(2, grid.window.max(2));
            let last = (frame + half).min(piece.end - 1);
            Parabola::new(frame, frame.saturating_sub(half).max(piece.start)..=last)
        };
        let [others @ .., shortest] = SMOOTHED;
        let mut longer = others.into_iter().map(around);
        let adequate = longer.find(|parabola| parabola.is_adequate(track, noise));
        let parabola = adequate.unwrap_or_else(|| around(shortest));
        let (from, to) = (*parabola.frames.start(), *parabola.frames.end());
        // The value of the parabola at the start.
        let weight = |k: usize| parabola.inverse.column(0).dot(&powers(k, frame));
        let centre = track.samples[frame].motion;
        let mut mean = Channels::zeros();
        let mut carried = UnitQuaternion::identity();
        let add = |mean: &mut Channels, k: usize, carried: &UnitQuaternion<f64>| {
            // The rotation in between is removed using the angular velocity.
            let mut motion = track.samples[k].motion;
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
    fn is_adequate(&self, track: &RecordedFlight, noise: f64) -> bool {
        let spin = |k: usize| track.samples[k].motion.angular_velocity.components;
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
fn turned(track: &RecordedFlight, from: usize, to: usize) -> UnitQuaternion<f64> {
    let spin = |k: usize| track.samples[k].motion.angular_velocity.components;
    let duration = track.samples[to].time - track.samples[from].time;
    UnitQuaternion::from_scaled_axis((spin(from) + spin(to)) * (0.5 * duration))
}
