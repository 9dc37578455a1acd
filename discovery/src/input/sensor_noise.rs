//! Estimates the noise of the sensors from the recording itself.

use bodyflight_core::flight_sample::FlightSample;
use bodyflight_falls::statistics::{
    noise_from_third_differences, quantile, second_difference, third_difference,
};
use nalgebra::{UnitQuaternion, Vector3};

use crate::input::flight::RecordedFlight;

/// Smallest credible noise of a frame, given rounding in files and integration steps of the model.
const LEAST_NOISE: [f64; 4] = [2e-4, 1e-3, 5e-3, 5e-3];

/// Standard deviations of single frames: attitude (rad), angular velocity (rad/s), horizontal and vertical velocity
/// (m/s).
///
/// Computed from third differences of neighbouring frames, in which a motion that is smooth over four frames cancels.
/// Rotations are first reduced by the measured angular velocity.
pub(crate) fn recorded_noise(track: &RecordedFlight) -> [f64; 4] {
    let samples = &track.samples;
    let attitude: Vec<Vector3<f64>> = samples
        .windows(2)
        .map(|pair| {
            let spin = |sample: &FlightSample| sample.motion.angular_velocity.components;
            let duration = pair[1].time - pair[0].time;
            let by_gyro = (spin(&pair[0]) + spin(&pair[1])) * (0.5 * duration);
            let turned = pair[0].motion.inertial_from_body.quaternion().inverse()
                * pair[1].motion.inertial_from_body.quaternion();
            (UnitQuaternion::from_scaled_axis(-by_gyro) * turned).scaled_axis()
        })
        .collect();
    let third = |values: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let third = |w: &[Vector3<f64>]| third_difference([w[0], w[1], w[2], w[3]]);
        values.windows(4).map(third).collect()
    };
    let second = |values: &[Vector3<f64>]| -> Vec<Vector3<f64>> {
        let second = |w: &[Vector3<f64>]| second_difference([w[0], w[1], w[2]]);
        values.windows(3).map(second).collect()
    };
    let velocity: Vec<Vector3<f64>> = samples
        .iter()
        .map(|sample| sample.motion.velocity_inertial().components)
        .collect();
    let spin: Vec<Vector3<f64>> = samples
        .iter()
        .map(|sample| sample.motion.angular_velocity.components)
        .collect();
    // The attitudes are already first differences.
    let (attitude, spin, velocity) = (second(&attitude), third(&spin), third(&velocity));
    let axes = |values: &[Vector3<f64>], axes: &[usize]| -> f64 {
        let sizes = values
            .iter()
            .flat_map(|v| axes.iter().map(|axis| v[*axis].abs()));
        noise_from_third_differences(quantile(sizes.collect(), 0.5))
    };
    let found = [
        axes(&attitude, &[0, 1, 2]),
        axes(&spin, &[0, 1, 2]),
        axes(&velocity, &[0, 1]),
        axes(&velocity, &[2]),
    ];
    core::array::from_fn(|k| found[k].max(LEAST_NOISE[k]))
}
