//! The sensor readings of a simulated stretch, and their residuals.

use bodyflight_core::dynamics::Motion;
use nalgebra::DVector;

use crate::input::flight::RecordedFlight;
use crate::shooting::stretch::{CHANNELS, Channels, Stretch, difference};

/// Number of channels of the attitude, which come first.
const ATTITUDE: usize = 3;

/// Sensor readings of a simulated stretch.
#[derive(Debug, Clone)]
pub(crate) struct Prediction {
    /// Readings at the start and after each interval.
    pub(crate) seen: Vec<Motion<f64>>,
    /// Number of frames in an interval.
    pub(crate) stride: usize,
}

impl Prediction {
    /// Residuals, measured less simulated, averaged over the frames of each window after its start.
    pub(crate) fn residual(&self, track: &RecordedFlight, stretch: &Stretch) -> DVector<f64> {
        let intervals = stretch.grid.window / self.stride;
        let weights = weights(intervals, self.stride);
        let mut averages = DVector::zeros(stretch.grid.residuals());
        for (k, seen) in self.seen.iter().enumerate() {
            let measured = &track.samples[stretch.first + k * self.stride].motion;
            let difference = difference(measured, seen);
            let mut add = |row: usize, weights: &Channels| {
                let mut mean = averages.rows_mut(row * CHANNELS, CHANNELS);
                mean += difference.component_mul(weights);
            };
            let (row, place) = (k / intervals, k % intervals);
            if row < stretch.grid.rows {
                add(row, &weights[place]);
            }
            if place == 0 && row > 0 {
                add(row - 1, &weights[intervals]);
            }
        }
        averages
    }
}

/// Weights of the simulated frames of a window, from its start to its end, for the mean over all frames after the start.
///
/// The load of a step is constant, so between simulated frames velocities are straight, and the attitude is a parabola.
fn weights(intervals: usize, stride: usize) -> Vec<Channels> {
    let frames = intervals * stride;
    let mut weights = vec![Channels::zeros(); intervals + 1];
    for frame in 1..=frames {
        let place = frame as f64 / stride as f64;
        let before = frame.div_ceil(stride) - 1;
        let after = place - before as f64;
        let straight = [(before, 1.0 - after), (before + 1, after)];
        for (at, weight) in straight {
            let mut velocities = weights[at].rows_mut(ATTITUDE, CHANNELS - ATTITUDE);
            velocities.add_scalar_mut(weight);
        }
        // A parabola through the nearest frames of the window.
        let middle = before.clamp(1, intervals.max(2) - 1);
        let after = place - middle as f64;
        let parabola = [
            (middle - 1, 0.5 * after * (after - 1.0)),
            (middle, 1.0 - after * after),
            (middle + 1, 0.5 * after * (after + 1.0)),
        ];
        let of_attitude = if intervals < 2 {
            &straight[..]
        } else {
            &parabola
        };
        for (at, weight) in of_attitude {
            weights[*at].rows_mut(0, ATTITUDE).add_scalar_mut(*weight);
        }
    }
    weights
        .iter()
        .map(|weight| weight / frames as f64)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Weights give the mean of a parabola in attitude and of a straight line in the velocities.
    #[test]
    fn a_mean_over_few_simulated_frames_is_that_over_all() {
        for (intervals, stride) in [(1, 1), (12, 1), (2, 6), (3, 4), (4, 6)] {
            let frames = intervals * stride;
            let mean = |power: i32| {
                let each = (1..=frames).map(|frame| (frame as f64 / stride as f64).powi(power));
                each.sum::<f64>() / frames as f64
            };
            for power in 0..=2 {
                let weights = weights(intervals, stride);
                let sum = weights.iter().enumerate();
                let sum: Channels = sum.map(|(k, weight)| weight * (k as f64).powi(power)).sum();
                assert!((sum[0] - mean(power)).abs() < 1e-12, "{intervals} {stride}");
                if power < 2 {
                    assert!((sum[8] - mean(power)).abs() < 1e-12, "{intervals} {stride}");
                }
            }
        }
    }
}
