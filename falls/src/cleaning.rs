//! Removes impossible rows of a receiver: heights inconsistent with the velocities, jumps of the velocity, gaps in
//! time.
//!
//! Receivers that were switched on late or lie against metal may give heights of 10 km for some seconds around the
//! exit, with good values before and after. A single limit cannot detect that, so rows are compared with their
//! neighbours.

use crate::{Sample, median};

/// Time on either side in which neighbours are used (s).
const NEIGHBOURS: f64 = 10.0;

/// Largest difference of a height from the value predicted by its neighbours and their velocities (m).
const HEIGHT: f64 = 80.0;

/// Largest difference of a velocity from the median of its neighbours (m/s).
const VELOCITY: f64 = 15.0;

/// Time on either side of a row in which velocities are compared (s): shorter than any opening.
const VELOCITY_NEIGHBOURS: f64 = 0.5;

/// Longest gap within a jump (s). A longer one means another flight, or a clock that was set between two rows.
const LONGEST_GAP: f64 = 60.0;

/// Highest rate of fixes that is used (Hz): no receiver of a logger has more than 25.
const HIGHEST_RATE: f64 = 30.0;

/// Fewest rows of a section between two such gaps, and the loss of height without which it has no jump (m).
const FEWEST: usize = 20;
const LOSES: f64 = 50.0;

/// Rows that were removed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TakenOut {
    /// Number of rows.
    pub count: usize,
    /// Time of the first removed row (s).
    pub first_time: Option<f64>,
}

/// Returns the sections between long gaps, without rows that disagree with their neighbours. Sections without a loss of
/// height are removed if another one has it.
pub fn cleaned(samples: &[Sample]) -> (Vec<Vec<Sample>>, TakenOut) {
    let samples = &thinned(samples)[..];
    let near = |before: &Sample, after: &Sample| after.time - before.time <= LONGEST_GAP;
    let mut out = TakenOut::default();
    let sections: Vec<&[Sample]> = samples.chunk_by(near).collect();
    let is_jump = |part: &[Sample]| part.len() >= FEWEST && height_range(part) >= LOSES;
    let has_jump = sections.iter().any(|part| is_jump(part));
    let mut kept = Vec::new();
    for part in sections {
        if has_jump && !is_jump(part) {
            out.count += part.len();
            let first = part.first().map(|sample| sample.time);
            out.first_time = out.first_time.or(first);
        } else {
            kept.push(consistent(part, &mut out));
        }
    }
    (kept, out)
}

/// The samples at no more than the highest rate; others would only repeat their neighbours.
fn thinned(samples: &[Sample]) -> Vec<Sample> {
    let mut kept: Vec<Sample> = Vec::with_capacity(samples.len());
    for sample in samples {
        if kept
            .last()
            .is_none_or(|last| sample.time - last.time >= 1.0 / HIGHEST_RATE)
        {
            kept.push(*sample);
        }
    }
    kept
}

/// Difference between the highest and the lowest sample (m).
fn height_range(part: &[Sample]) -> f64 {
    let heights = || part.iter().map(Sample::height);
    heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min)
}

/// A section without the rows that disagree with their neighbours.
fn consistent(samples: &[Sample], out: &mut TakenOut) -> Vec<Sample> {
    // Height plus the distance fallen, which should be nearly constant.
    let mut way = 0.0;
    let mut left: Vec<f64> = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        if let Some(before) = index.checked_sub(1).map(|before| &samples[before]) {
            let step = (sample.time - before.time).min(NEIGHBOURS);
            way += 0.5 * (sample.velocity.z + before.velocity.z) * step;
        }
        left.push(sample.height() - way);
    }
    let mut kept = Vec::with_capacity(samples.len());
    for (index, sample) in samples.iter().enumerate() {
        let around = neighbours(samples, index, NEIGHBOURS);
        let height_off = median(around.map(|other| left[other]))
            .map_or(0.0, |middle| (left[index] - middle).abs());
        let near = || neighbours(samples, index, VELOCITY_NEIGHBOURS);
        let velocity_off = (0..3)
            .filter_map(|axis| {
                let middle = median(near().map(|other| samples[other].velocity[axis]))?;
                Some((sample.velocity[axis] - middle).abs())
            })
            .fold(0.0, f64::max);
        if height_off > HEIGHT || velocity_off > VELOCITY {
            out.count += 1;
            out.first_time.get_or_insert(sample.time);
        } else {
            kept.push(*sample);
        }
    }
    kept
}

/// Indices of the samples within `reach` (s) of a sample, including it.
fn neighbours(samples: &[Sample], index: usize, reach: f64) -> core::ops::Range<usize> {
    let time = samples[index].time;
    let first = samples[..index].partition_point(|sample| sample.time < time - reach);
    let last = index + samples[index..].partition_point(|sample| sample.time <= time + reach);
    first..last
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::synthetic::{Jump, jump};

    #[test]
    fn heights_that_jump_around_the_exit_are_taken_out_and_counted() {
        let mut samples = jump(&Jump::default());
        let exit = samples.partition_point(|sample| sample.time < 60.0);
        for sample in &mut samples[exit..exit + 15] {
            sample.position.z = 11_600.0;
        }
        samples[exit + 100].velocity.x += 60.0;
        let (kept, out) = cleaned(&samples);
        assert_eq!(out.count, 16);
        assert_eq!(kept[0].len(), samples.len() - 16);
        assert_eq!(out.first_time, Some(samples[exit].time));
    }

    #[test]
    fn rows_of_another_millennium_are_taken_out_and_counted() {
        let good = jump(&Jump::default());
        let mut samples = good.clone();
        for sample in &mut samples[..7] {
            sample.time -= 3.2e10;
        }
        let (kept, out) = cleaned(&samples);
        assert_eq!(kept, [good[7..].to_vec()]);
        assert_eq!(out.count, 7);
        assert_eq!(out.first_time, Some(samples[0].time));
    }

    #[test]
    fn a_good_jump_is_left_unchanged() {
        assert_eq!(cleaned(&jump(&Jump::default())).1, TakenOut::default());
    }
}
