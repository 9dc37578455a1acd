//! Estimates the noise of the sensors from the recording itself.

use bodyflight_core::dynamics::Motion;
use nalgebra::{UnitQuaternion, Vector3};

use super::statistics::quantile;
use super::track::Track;

/// Smallest credible noise of a frame, given rounding in files and integration steps of the model.
const LEAST: [f64; 4] = [2e-4, 1e-3, 5e-3, 5e-3];

/// Standard deviations of single frames: attitude (rad), angular velocity (rad/s), horizontal and vertical velocity
/// (m/s).
///
/// Computed from third differences of neighbouring frames, in which a motion that is smooth over four frames cancels.
/// Rotations are first reduced by the measured angular velocity.
pub fn recorded_noise(track: &Track) -> [f64; 4] {
    let motions = &track.measured;
    let attitude: Vec<Vector3<f64>> = motions
        .windows(2)
        .zip(track.times.windows(2))
        .map(|(pair, times)| {
            let spin = |motion: &Motion<f64>| motion.angular_velocity.components;
            let by_gyro = (spin(&pair[0]) + spin(&pair[1])) * (0.5 * (times[1] - times[0]));
            let turned = pair[0].inertial_from_body.quaternion().inverse()
                * pair[1].inertial_from_body.quaternion();
            (UnitQuaternion::from_scaled_axis(-by_gyro) * turned).scaled_axis()
        })
        .collect();
    let third = |values: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let third = |w: &[Vector3<f64>]| w[3] - w[2] * 3.0 + w[1] * 3.0 - w[0];
        values.windows(4).map(third).collect()
    };
    let second = |values: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let second = |w: &[Vector3<f64>]| w[2] - w[1] * 2.0 + w[0];
        values.windows(3).map(second).collect()
    };
    let velocity: Vec<Vector3<f64>> = motions
        .iter()
        .map(|motion| motion.velocity_inertial().components)
        .collect();
    let spin: Vec<Vector3<f64>> = motions
        .iter()
        .map(|motion| motion.angular_velocity.components)
        .collect();
    // The attitudes are already first differences.
    let (attitude, spin, velocity) = (second(&attitude), third(&spin), third(&velocity));
    let axes = |values: &[Vector3<f64>], axes: &[usize]| -> f64 {
        let sizes = values
            .iter()
            .flat_map(|v| axes.iter().map(|axis| v[*axis].abs()));
        // The median magnitude of a normal variable is 0.6745 standard deviations; the squared weights 1, 3, 3, 1 sum
        // to 20.
        quantile(sizes.collect(), 0.5) / 0.6745 / 20.0f64.sqrt()
    };
    let found = [
        axes(&attitude, &[0, 1, 2]),
        axes(&spin, &[0, 1, 2]),
        axes(&velocity, &[0, 1]),
        axes(&velocity, &[2]),
    ];
    core::array::from_fn(|k| found[k].max(LEAST[k]))
}
