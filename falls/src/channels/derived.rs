//! Velocities from positions.

use nalgebra::{Matrix3, Vector3};

use crate::{Sample, median};

/// Time before and after a sample over which its velocity is derived from positions (s).
const REACH: f64 = 1.0;

/// Sets each velocity to the slope of a parabola fitted to the surrounding positions (least squares).
pub fn with_velocities(samples: &mut [Sample]) {
    let derived = velocities(samples);
    for (sample, velocity) in samples.iter_mut().zip(derived) {
        sample.velocity = velocity;
    }
}

/// Half of the time over which such a velocity is the mean (s). Over many samples, the slope of a parabola weights the
/// velocities with a parabola that vanishes at `REACH`, as wide as a mean over 0.77 of it; over three, it is the mean
/// between the outer ones.
pub(super) fn averaged(samples: &[Sample]) -> f64 {
    let steps = samples.windows(2).map(|pair| pair[1].time - pair[0].time);
    median(steps).unwrap_or(REACH).max(0.77 * REACH)
}

/// Velocity at each sample according to the positions (m/s).
pub(super) fn velocities(samples: &[Sample]) -> Vec<Vector3<f64>> {
    let (mut first, mut end) = (0, 0);
    let mut velocities = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        while samples[first].time < sample.time - REACH {
            first += 1;
        }
        while end < samples.len() && samples[end].time <= sample.time + REACH {
            end += 1;
        }
        let from = first.min(index.saturating_sub(1));
        let to = end.max(index + 2).min(samples.len());
        velocities.push(parabola(&samples[from..to], sample.time));
    }
    velocities
}

/// Slope at `time` (s) of the parabola that fits the positions best; if they do not determine one, of the line from the
/// first to the last.
fn parabola(part: &[Sample], time: f64) -> Vector3<f64> {
    let mut normal = Matrix3::zeros();
    let mut right = Matrix3::zeros();
    for sample in part {
        let since = sample.time - time;
        let row = Vector3::new(1.0, since, since * since);
        normal += row * row.transpose();
        right += row * sample.position.transpose();
    }
    if part.len() > 2
        && let Some(inverse) = normal.try_inverse()
    {
        return (inverse * right).row(1).transpose();
    }
    match part {
        [first, .., last] => (last.position - first.position) / (last.time - first.time),
        _ => Vector3::zeros(),
    }
}
