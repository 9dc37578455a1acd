//! Heights that jump from one row to the next and stay there, while the vertical velocities do not.

use super::compare::{Channel, Finding, Remedy, displacements};
use crate::{Sample, between, longest_step, median};

/// Smallest jump (m): heights of receivers wander by less.
const JUMPS: f64 = 25.0;

/// Time on either side over which heights must stay (s), and fewest rows in it.
const STAYS: f64 = 3.0;
const FEWEST: usize = 4;

/// Largest scatter of the heights on either side, as a fraction of the jump.
const SCATTER: f64 = 0.2;

/// Jumps beyond which a receiver has not merely found another height a few times.
const MOST: usize = 4;

/// Share of rows that leap, whether or not they stay there, above which they are not one track.
const LEAPS: f64 = 0.05;

/// Moves the heights before each jump so that they meet those after it, which end on the ground. Returns whether the
/// heights can be trusted: those of two tracks in one file jump to and fro.
pub(super) fn checked(samples: &mut [Sample], findings: &mut Vec<Finding>) -> bool {
    let gap = longest_step(samples);
    let displacements = displacements(samples, 2, gap);
    let left: Vec<Sample> = samples
        .iter()
        .zip(displacements)
        .map(|(sample, displacement)| {
            let mut left = *sample;
            left.position.z -= displacement;
            left
        })
        .collect();
    let mut jumps = Vec::new();
    let mut leaps = Vec::new();
    for index in 1..left.len() {
        let [before, after] = [left[index - 1], left[index]];
        let jump = after.height() - before.height();
        if jump.abs() <= JUMPS || after.time - before.time > gap {
            continue;
        }
        leaps.push((index, jump));
        if stays(
            between(&left, [before.time - STAYS, before.time]),
            before.height(),
            jump,
        ) && stays(
            between(&left, [after.time, after.time + STAYS]),
            after.height(),
            jump,
        ) {
            jumps.push((index, jump));
        }
    }
    #[expect(clippy::cast_precision_loss, reason = "counts of rows")]
    let is_mixed = leaps.len() as f64 > LEAPS * samples.len() as f64;
    if is_mixed {
        jumps = leaps;
    }
    let is_trusted = jumps.len() <= MOST;
    for (index, jump) in jumps.iter().filter(|_| is_trusted) {
        for sample in &mut samples[..*index] {
            sample.position.z += jump;
        }
    }
    let largest = jumps
        .iter()
        .max_by(|(_, a), (_, b)| a.abs().total_cmp(&b.abs()));
    let (Some((index, jump)), Some(first)) = (largest, samples.first()) else {
        return true;
    };
    let then = if is_trusted {
        "those before it are moved"
    } else {
        "rows of two tracks may be mixed"
    };
    let times = match jumps.len() {
        1 => String::new(),
        count => format!(", the largest of {count} jumps"),
    };
    findings.push(Finding {
        channel: Channel::Height,
        remedy: if is_trusted {
            Remedy::Converted
        } else {
            Remedy::Reported
        },
        sentence: format!(
            "the heights jump by {jump:.0} m at {:.1} s{times}, and the vertical velocities do not: {then}",
            samples[*index].time - first.time
        ),
    });
    is_trusted
}

/// Whether the rows lie around a height, up to a fraction of the jump.
fn stays(rows: &[Sample], height: f64, jump: f64) -> bool {
    let apart = rows.iter().map(|row| (row.height() - height).abs());
    rows.len() >= FEWEST && median(apart).is_some_and(|apart| apart < SCATTER * jump.abs())
}
