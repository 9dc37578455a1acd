//! Analysis of a jump from a logger's track: a satellite receiver measures position and velocity of a skydiver, but not
//! the posture.
//!
//! The steps, one file each: impossible rows are removed ([`cleaning`]), the track is divided into phases ([`phases`]),
//! the wind is estimated from the drift of the fall ([`wind`]), drag and lift over time are divided into pieces of
//! constant posture ([`drag`]), circles under canopy give a second estimate of the wind ([`canopy`]), and the last
//! third of the fall is predicted from the first two ([`prediction`]). [`fall`] combines them, and [`verdict`] judges
//! the result.
#![forbid(unsafe_code)]

pub mod atmosphere;
pub mod canopy;
pub mod cleaning;
pub mod drag;
pub mod fall;
pub mod phases;
pub mod prediction;
#[cfg(test)]
mod synthetic;
pub mod verdict;
pub mod wind;

use nalgebra::Vector3;

/// One fix of a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time (s), from an arbitrary origin.
    pub time: f64,
    /// North and west of an arbitrary origin, and height above mean sea level (m).
    pub position: Vector3<f64>,
    /// Velocity over ground, north, west, up (m/s).
    pub velocity: Vector3<f64>,
}

impl Sample {
    /// Height above mean sea level (m).
    pub fn height(&self) -> f64 {
        self.position.z
    }

    /// Horizontal speed over ground (m/s).
    pub fn across(&self) -> f64 {
        self.velocity.xy().norm()
    }
}

/// The median; `None` if there are no values.
pub fn median(values: impl IntoIterator<Item = f64>) -> Option<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let upper = *values.get(middle)?;
    Some(if values.len().is_multiple_of(2) {
        0.5 * (upper + values[middle - 1])
    } else {
        upper
    })
}

/// Slopes of values over time by least squares within `reach` (s) of each sample; for velocities, the acceleration.
pub fn slopes(samples: &[Sample], reach: f64) -> Vec<Vector3<f64>> {
    let mut slopes = Vec::with_capacity(samples.len());
    let (mut first, mut last) = (0, 0);
    for (index, sample) in samples.iter().enumerate() {
        while samples[first].time < sample.time - reach {
            first += 1;
        }
        while last < samples.len() && samples[last].time <= sample.time + reach {
            last += 1;
        }
        // At least one neighbour on each side, if there is one.
        let from = first.min(index.saturating_sub(1));
        let to = last.max((index + 2).min(samples.len()));
        slopes.push(slope(&samples[from..to]));
    }
    slopes
}

fn slope(part: &[Sample]) -> Vector3<f64> {
    let count = part.len() as f64;
    let time = part.iter().map(|sample| sample.time).sum::<f64>() / count;
    let mean = part
        .iter()
        .map(|sample| sample.velocity)
        .sum::<Vector3<f64>>()
        / count;
    let mut square = 0.0;
    let mut product = Vector3::zeros();
    for sample in part {
        let since = sample.time - time;
        square += since * since;
        product += (sample.velocity - mean) * since;
    }
    if square > 0.0 {
        product / square
    } else {
        Vector3::zeros()
    }
}
