//! The balance of momentum, in weak form: what force and moment are missing, window by window.
//!
//! Linear and angular momentum of the measured motion are weighed by a bump that is zero at both ends of a window, so
//! their changes need no derivative: the sums are shifted to the bump. What the model's forces add up to in the same
//! frames is taken off. Each window has the covariance that the noise of the sensors gives it. For looking at; the
//! search itself compares short free runs, whose errors are linear in what joints have wrong.

use bodyflight_core::dynamics::{Motion, State};
use bodyflight_core::effect::Model;
use bodyflight_core::effect::sensors::Moving;
use nalgebra::{Matrix6, SMatrix, Vector6};
use rayon::prelude::*;
use serde::Serialize;

use super::flown::behind;
use super::stretch::{CHANNELS, Channels, SENSOR_NOISE, moved};
use super::track::Track;

/// Frames of a window and from one window to the next: 0.6 and 0.2 s at 240 Hz.
const FRAMES: usize = 144;
const APART: usize = 48;

/// Force (inertial axes) and moment (body axes, about the centre of gravity) that are missing in one window.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Missing {
    /// Middle of the window (s).
    pub time_s: f64,
    /// North, west, up (N).
    pub force_n: [f64; 3],
    /// Standard errors (N).
    pub force_error_n: [f64; 3],
    /// Left, dorsal, cranial (N m).
    pub moment_nm: [f64; 3],
    /// Standard errors (N m).
    pub moment_error_nm: [f64; 3],
    /// All six in deviations, by their covariance.
    pub deviations: f64,
}

/// The bump over the frames of a window, zero at both ends.
fn bump(frame: usize) -> f64 {
    let place = (2 * frame) as f64 / FRAMES as f64 - 1.0;
    (1.0 - place * place).powi(2)
}

/// Missing force and moment over the flight.
pub fn balance(track: &Track, model: &Model<f64>) -> Vec<Missing> {
    let last = track.times.len().saturating_sub(FRAMES + 1);
    let windows: Vec<usize> = (0..last).step_by(APART).collect();
    windows
        .into_par_iter()
        .filter_map(|first| window(track, model, first))
        .collect()
}

fn window(track: &Track, model: &Model<f64>, first: usize) -> Option<Missing> {
    let middle = first + FRAMES / 2;
    let mut missing = Vector6::zeros();
    let mut weight = 0.0;
    let mut covariance = Matrix6::zeros();
    let to_body = track.measured[middle].inertial_from_body.inverse();
    let noise = Channels::from(SENSOR_NOISE);
    let at_middle = Slopes::of(track, model, middle);
    for k in 1..FRAMES {
        let frame = first + k;
        let (rise, here) = (bump(k) - bump(k - 1), bump(k));
        let (momentum, pull) = terms(track, model, frame, &true_motion(track, model, frame));
        missing -= momentum * rise + pull * here;
        weight += here * (track.times[frame + 1] - track.times[frame]);
        // What one frame's noise does to the sum; slopes hardly change within a window.
        let slope = at_middle.momentum * rise + at_middle.pull * here;
        let spread = SMatrix::<f64, 6, CHANNELS>::from_fn(|row, column| {
            slope[(row, column)] * noise[column]
        });
        covariance += spread * spread.transpose();
    }
    let turned = |mut six: Vector6<f64>| {
        let moment = to_body * bodyflight_core::frame::Vector::new(six[3], six[4], six[5]);
        six.fixed_rows_mut::<3>(3).copy_from(&moment.components);
        six
    };
    // Moments in body axes: each column of a turned factor is turned.
    let mut factor = covariance.cholesky()?.l();
    for mut column in factor.column_iter_mut() {
        let six = turned(column.clone_owned());
        column.copy_from(&six);
    }
    let missing = turned(missing) / weight;
    let covariance = factor * factor.transpose() / (weight * weight);
    let deviations = missing.dot(&covariance.cholesky()?.solve(&missing)).sqrt();
    let errors = covariance.diagonal().map(f64::sqrt);
    let three = |six: &Vector6<f64>, from: usize| [six[from], six[from + 1], six[from + 2]];
    Some(Missing {
        time_s: track.times[middle],
        force_n: three(&missing, 0),
        force_error_n: three(&errors, 0),
        moment_nm: three(&missing, 3),
        moment_error_nm: three(&errors, 3),
        deviations,
    })
}

/// The motion behind a measured one: errors of the sensors that the model knows are taken off.
fn true_motion(track: &Track, model: &Model<f64>, frame: usize) -> Motion<f64> {
    let time = track.times[frame] - track.times[0];
    let past = |delay: f64| {
        let then = track.times[frame] - delay;
        let place = track.times.partition_point(|time| *time < then);
        Moving::of(&track.measured[place.min(track.measured.len() - 1)])
    };
    behind(&track.measured[frame], |motion| {
        model.sensors.observe(motion, past, time)
    })
}

/// Momentum, and by how much the forces of the model change it until the next frame.
fn terms(
    track: &Track,
    model: &Model<f64>,
    frame: usize,
    motion: &Motion<f64>,
) -> (Vector6<f64>, Vector6<f64>) {
    let duration = track.times[frame + 1] - track.times[frame];
    let (from, to) = (&track.postures[frame], &track.postures[frame + 1]);
    let sample = model.dynamics.between(from, to, duration);
    let state = State::from_motion(motion, &sample);
    let inputs = model.inputs(&track.inputs);
    let next = model.dynamics.step(&state, &sample, &inputs, duration);
    let six = |state: &State<f64>| {
        let (linear, angular) = (
            &state.linear_momentum.components,
            &state.angular_momentum.components,
        );
        Vector6::from_iterator(linear.iter().chain(angular).copied())
    };
    (six(&state), six(&next) - six(&state))
}

/// What a change in each measured channel does to the terms of a frame.
struct Slopes {
    momentum: SMatrix<f64, 6, CHANNELS>,
    pull: SMatrix<f64, 6, CHANNELS>,
}

impl Slopes {
    fn of(track: &Track, model: &Model<f64>, frame: usize) -> Self {
        const STEP: f64 = 1e-4;
        let motion = true_motion(track, model, frame);
        let (momentum, pull) = terms(track, model, frame, &motion);
        let mut slopes = Self {
            momentum: SMatrix::zeros(),
            pull: SMatrix::zeros(),
        };
        for channel in 0..CHANNELS {
            let mut step = Channels::zeros();
            step[channel] = STEP;
            let (there, pull_there) = terms(track, model, frame, &moved(&motion, &step));
            slopes
                .momentum
                .set_column(channel, &((there - momentum) / STEP));
            slopes
                .pull
                .set_column(channel, &((pull_there - pull) / STEP));
        }
        slopes
    }
}
