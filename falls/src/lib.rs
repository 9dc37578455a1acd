//! Analysis of a jump from a logger's track: a satellite receiver measures position and velocity of a skydiver, but not
//! the posture.
//!
//! The steps, one file each: channels that contradict each other are found ([`channels`]), impossible rows are removed
//! ([`cleaning`]), the track is divided into phases ([`phases`]) and these into jumps ([`jumps`]), whose boundaries are
//! placed ([`boundary`]), the wind is estimated from the drift of the fall ([`wind`]), drag and lift over time are divided
//! into pieces of constant posture ([`drag`]), circles under canopy give a second estimate of the wind ([`canopy`]), and the last
//! third of the fall is predicted from the first two ([`prediction`]). [`fall`] combines them, and [`verdict`] judges
//! the result.
#![forbid(unsafe_code)]

pub mod atmosphere;
pub mod boundary;
pub mod canopy;
pub mod channels;
pub mod cleaning;
pub mod drag;
pub mod fall;
pub mod force;
pub mod jump;
pub mod jumps;
pub mod phases;
pub mod prediction;
pub mod statistics;
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

/// Longest time between two fixes that follow one another (s): a longer one means that fixes are missing.
pub fn longest_step(samples: &[Sample]) -> f64 {
    let steps = samples.windows(2).map(|pair| pair[1].time - pair[0].time);
    median(steps).map_or(1.5, |step| (3.0 * step).clamp(1.5, 12.0))
}

/// The samples from one time (s) to another, both included.
pub fn between(samples: &[Sample], [from, to]: [f64; 2]) -> &[Sample] {
    let first = samples.partition_point(|sample| sample.time < from);
    let end = samples.partition_point(|sample| sample.time <= to);
    samples.get(first..end).unwrap_or_default()
}

/// The samples between two times (s) that no missing fix separates from the one at `near` (s).
pub fn connected(samples: &[Sample], near: f64, [from, to]: [f64; 2]) -> &[Sample] {
    let gap = longest_step(samples);
    let place = samples.partition_point(|sample| sample.time < near);
    let mut first = place.min(samples.len());
    while first > 0
        && samples[first - 1].time >= from
        && (samples.get(first)).is_none_or(|next| next.time - samples[first - 1].time <= gap)
    {
        first -= 1;
    }
    let mut last = place.min(samples.len());
    while last < samples.len()
        && samples[last].time <= to
        && (last == 0 || samples[last].time - samples[last - 1].time <= gap)
    {
        last += 1;
    }
    samples.get(first..last).unwrap_or(&[])
}

/// Slopes of the velocity over time by least squares within `reach` (s) of each sample: the acceleration. Samples
/// beyond missing fixes take no part.
pub fn slopes(samples: &[Sample], reach: f64) -> Vec<Vector3<f64>> {
    let gap = longest_step(samples);
    let connected = |a: &Sample, b: &Sample| b.time - a.time <= gap;
    let mut slopes = Vec::with_capacity(samples.len());
    for part in samples.chunk_by(connected) {
        let (mut first, mut last) = (0, 0);
        for (index, sample) in part.iter().enumerate() {
            while part[first].time < sample.time - reach {
                first += 1;
            }
            while last < part.len() && part[last].time <= sample.time + reach {
                last += 1;
            }
            // At least one neighbour on each side, if there is one.
            let from = first.min(index.saturating_sub(1));
            let to = last.max((index + 2).min(part.len()));
            slopes.push(slope(&part[from..to]));
        }
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
