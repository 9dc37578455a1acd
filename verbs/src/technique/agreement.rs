//! How far the linear response agrees with the full simulation.

use core::f64::consts::TAU;

use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::step::TIME_STEP;
use nalgebra::DVector;
use serde::Serialize;

use super::linear::Linear;
use bodyflight_core::body::joint_angle::JointAngle;
use bodyflight_core::body::joint_angle::REACH;

/// Share by which the two may differ.
pub const LIMIT: f64 = 0.1;
/// Amplitudes tried (degrees).
pub const AMPLITUDES_DEG: [f64; 8] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 24.0, 32.0];
/// Frequencies of the sinusoids (Hz).
const FREQUENCIES_HZ: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Length of a run (s).
const SECONDS: f64 = 2.0;
/// A response below this share of the turn rate of the model's other errors is not judged (rad/s per rad).
const SMALLEST: f64 = 0.02;

/// Agreement for one input.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Agreement {
    /// Frequency of a sinusoid (Hz); null for a step within 0.2 s.
    pub frequency_hz: Option<f64>,
    /// Largest amplitude tried up to which the turn rates differ by at most 10 % (rad); null if none.
    pub valid_to_rad: Option<f64>,
    /// Difference of the turn rates at the smallest amplitude, RMS for that of the linear response.
    pub error_at_smallest: f64,
    /// Whether a larger amplitude was tried and failed.
    pub is_limit: bool,
}

/// Amplitude at each step of a smooth step to `size` (rad) or a sinusoid.
pub fn input(frequency_hz: Option<f64>, size: f64, seconds: f64) -> Vec<f64> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few seconds"
    )]
    let steps = (seconds / TIME_STEP) as u32;
    let at = |k: u32| {
        let time = TIME_STEP * f64::from(k);
        match frequency_hz {
            Some(frequency) => (TAU * frequency * time).sin(),
            None => {
                let share = (time / REACH).min(1.0);
                share * share * (3.0 - 2.0 * share)
            }
        }
    };
    (0..=steps).map(|k| size * at(k)).collect()
}

/// Agreement of the turn rate for a step and sinusoids; empty if the pattern does not turn the body.
pub fn agreement(
    linear: &Linear,
    dynamics: &Dynamics<f64>,
    axes: &[JointAngle],
    weights: &DVector<f64>,
) -> Vec<Agreement> {
    let single = linear.of_pattern(weights);
    let shapes = FREQUENCIES_HZ.map(Some);
    let all = std::iter::once(None).chain(shapes);
    all.filter_map(|frequency_hz| {
        let error = |degrees: f64| {
            let amplitude = input(frequency_hz, degrees.to_radians(), SECONDS);
            let expected = single.response(&amplitude);
            let size = rms(expected.iter().map(|seen| seen[0]));
            if size < SMALLEST * degrees.to_radians() {
                return None;
            }
            let flown = linear.flown(dynamics, axes, weights, &amplitude);
            let apart = flown.map_or(f64::INFINITY, |flown| {
                rms(flown.iter().zip(&expected).map(|(a, b)| a[0] - b[0]))
            });
            Some(apart / size)
        };
        let (mut error_at_smallest, mut valid, mut is_limit) = (None, None, false);
        for degrees in AMPLITUDES_DEG {
            let error = error(degrees)?;
            error_at_smallest.get_or_insert(error);
            if error > LIMIT {
                is_limit = true;
                break;
            }
            valid = Some(degrees.to_radians());
        }
        Some(Agreement {
            frequency_hz,
            valid_to_rad: valid,
            error_at_smallest: error_at_smallest?,
            is_limit,
        })
    })
    .collect()
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        count += 1.0;
    }
    (sum / f64::max(count, 1.0)).sqrt()
}
