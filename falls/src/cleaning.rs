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

/// Rows that were removed.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TakenOut {
    /// Number of rows.
    pub count: usize,
    /// Time of the first removed row (s).
    pub first_time: Option<f64>,
}

/// Returns the section between long gaps that loses the most height, without rows that disagree with their neighbours.
pub fn cleaned(samples: &[Sample]) -> (Vec<Sample>, TakenOut) {
    let whole = samples;
    let samples = jump_without_gaps(whole);
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
    let mut out = TakenOut {
        count: whole.len() - samples.len(),
        first_time: outside(whole, samples).map(|sample| sample.time),
    };
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
            out.first_time = Some(
                out.first_time
                    .map_or(sample.time, |first| first.min(sample.time)),
            );
        } else {
            kept.push(*sample);
        }
    }
    (kept, out)
}

/// The section between two gaps that loses the most height.
fn jump_without_gaps(samples: &[Sample]) -> &[Sample] {
    let lost = |part: &[Sample]| {
        let heights = || part.iter().map(Sample::height);
        heights().fold(f64::MIN, f64::max) - heights().fold(f64::MAX, f64::min)
    };
    let near = |before: &Sample, after: &Sample| after.time - before.time <= LONGEST_GAP;
    (samples.chunk_by(near))
        .map(|part| (lost(part), part))
        .max_by(|(a, _), (b, _)| a.total_cmp(b))
        .map_or(&[], |(_, part)| part)
}

/// The first row of `whole` that is not in `part`.
fn outside<'a>(whole: &'a [Sample], part: &[Sample]) -> Option<&'a Sample> {
    let begin = part.first()?.time;
    whole.iter().find(|sample| sample.time < begin).or_else(|| {
        let end = part.last()?.time;
        whole.iter().find(|sample| sample.time > end)
    })
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
        assert_eq!(kept.len(), samples.len() - 16);
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
        assert_eq!(kept, good[7..]);
        assert_eq!(out.count, 7);
        assert_eq!(out.first_time, Some(samples[0].time));
    }

    #[test]
    fn a_good_jump_is_left_unchanged() {
        assert_eq!(cleaned(&jump(&Jump::default())).1, TakenOut::default());
    }
}
