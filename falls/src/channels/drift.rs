//! Heights that drift against vertical velocities, as those of a barometer that warms up, or velocities that are
//! biased.
//!
//! What is left of the heights after the integral of the velocities is a constant if both are right. At rest, the one
//! that moves is wrong; without rest it is not certain which one is.

use nalgebra::{Matrix2, Vector2};

use super::compare::{Channel, Finding, Remedy, displacements};
use crate::{Sample, between, longest_step, median};

/// Smallest drift over a track that is reported (m), and smallest rate (m/s): heights of receivers wander by some
/// metres, and their velocities are good to some centimetres per second.
const DRIFTS: f64 = 20.0;
const RATE: f64 = 0.06;

/// Deviations at which a drift is certain: by chance once in ten thousand tracks, as they are told from twelve parts.
const CERTAIN: f64 = 6.0;

/// Number of parts of a track, and the time on either side of their borders over which heights are medians (s).
const PARTS: usize = 12;
const AROUND: f64 = 3.0;

/// Shortest track that shows a drift (s).
const SHORTEST: f64 = 100.0;

/// Shortest rest (s), the time over which rest is judged, and speed (m/s) and displacement (m) over ground that are
/// rest.
const RESTS: f64 = 7.0;
const WITHIN: f64 = 4.0;
const STILL: f64 = 0.8;
const STAYS: f64 = 6.0;

/// Largest difference of the velocity at rest from the expected one, as a fraction of the drift.
const SAME: f64 = 0.35;

/// Compares heights with integrated vertical velocities over the whole track. `has_places` says whether there are
/// horizontal positions, by which rest is seen.
pub(super) fn checked(samples: &mut [Sample], has_places: bool, findings: &mut Vec<Finding>) {
    let Some((rate, deviation, span)) = drift(samples) else {
        return;
    };
    if rate.abs() < CERTAIN * deviation || rate.abs() < RATE || (rate * span).abs() < DRIFTS {
        return;
    }
    let said = format!(
        "heights and vertical velocities drift apart by {:.2} m/s, {:.0} m over the track",
        rate.abs(),
        (rate * span).abs()
    );
    let at_rest = if has_places { at_rest(samples) } else { None };
    // The vertical velocity at rest, which is zero if the velocities are right.
    let near = |other: f64| at_rest.filter(|speed| (speed - other).abs() < SAME * rate.abs());
    let (channel, remedy, sentence) = match (near(0.0), near(-rate)) {
        (Some(_), _) => {
            let end = samples.last().map_or(0.0, |last| last.time);
            for sample in samples.iter_mut() {
                sample.position.z -= rate * (sample.time - end);
            }
            (
                Channel::Height,
                Remedy::Converted,
                format!(
                    "{said}: the velocities are zero at rest, so the heights drift, which is taken out"
                ),
            )
        }
        (_, Some(_)) => {
            for sample in samples.iter_mut() {
                sample.velocity.z += rate;
            }
            (
                Channel::VerticalVelocity,
                Remedy::Converted,
                format!("{said}: the velocities are not zero at rest, which is taken out"),
            )
        }
        _ => (
            Channel::Height,
            Remedy::Reported,
            format!("{said}: a barometer may be the cause, and heights may be off by as much"),
        ),
    };
    findings.push(Finding {
        channel,
        remedy,
        sentence,
    });
}

/// The rate of the drift (m/s), its deviation, and the time (s) over which it was seen.
///
/// The track is cut into parts; what is left of the change of height in each is a drift and a factor of the
/// displacement, which is another fault. Errors of both channels are alike for some time, so each part is one
/// observation.
fn drift(samples: &[Sample]) -> Option<(f64, f64, f64)> {
    let gap = longest_step(samples);
    let run = samples
        .chunk_by(|before, after| after.time - before.time <= gap)
        .max_by_key(|run| run.len())?;
    let (first, last) = (run.first()?, run.last()?);
    let span = last.time - first.time;
    if span < SHORTEST {
        return None;
    }
    let displacements = displacements(run, 2, gap);
    let length = (span - 2.0 * AROUND) / PARTS as f64;
    let border = |number: usize| {
        let time = first.time + AROUND + length * number as f64;
        let from = run.partition_point(|sample| sample.time < time - AROUND);
        let to = run.partition_point(|sample| sample.time <= time + AROUND);
        let left = (from..to).map(|index| run[index].height() - displacements[index]);
        Some((
            median(left)?,
            median(displacements.get(from..to)?.iter().copied())?,
        ))
    };
    let borders: Vec<(f64, f64)> = (0..=PARTS).filter_map(border).collect();
    if borders.len() <= PARTS {
        return None;
    }
    let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
    let rows: Vec<(Vector2<f64>, f64)> = borders
        .windows(2)
        .map(|pair| {
            let row = Vector2::new(1.0, (pair[1].1 - pair[0].1) / length);
            (row, (pair[1].0 - pair[0].0) / length)
        })
        .collect();
    for (row, left) in &rows {
        normal += row * row.transpose();
        right += row * *left;
    }
    let inverse = normal.try_inverse()?;
    let found = inverse * right;
    let squares = rows
        .iter()
        .map(|(row, left)| (left - row.dot(&found)).powi(2));
    let variance = squares.sum::<f64>() / (PARTS as f64 - 2.0);
    Some((found.x, (inverse[(0, 0)] * variance).sqrt(), span))
}

/// The vertical velocity during the longest rest of a track (m/s).
fn at_rest(samples: &[Sample]) -> Option<f64> {
    let rests: Vec<bool> = samples
        .iter()
        .map(|sample| {
            let around = between(samples, [sample.time - WITHIN, sample.time + WITHIN]);
            let displacement = |other: &Sample| (other.position - sample.position).xy().norm();
            median(around.iter().map(Sample::across)).is_some_and(|speed| speed < STILL)
                && around.iter().map(displacement).fold(0.0, f64::max) < STAYS
        })
        .collect();
    let mut runs: Vec<[usize; 2]> = Vec::new();
    for (index, rests) in rests.into_iter().enumerate() {
        match runs.last_mut() {
            Some(run) if rests && run[1] == index => run[1] += 1,
            _ if rests => runs.push([index, index + 1]),
            _ => {}
        }
    }
    let run = runs
        .iter()
        .map(|run| &samples[run[0]..run[1]])
        .max_by(|a, b| length(a).total_cmp(&length(b)))?;
    let sinks = median(run.iter().map(|sample| sample.velocity.z));
    sinks.filter(|_| length(run) > RESTS)
}

fn length(run: &[Sample]) -> f64 {
    match run {
        [first, .., last] => last.time - first.time,
        _ => 0.0,
    }
}
