//! Heights, or positions, that jump from one row to the next and stay there, while their velocities do not.

use nalgebra::Vector3;

use super::compare::{Channel, Finding, Remedy, displacements};
use crate::{Sample, between, longest_step, median};

/// Smallest jump of heights and of positions (m): those of receivers wander by less.
const JUMPS: f64 = 25.0;
const JUMPS_ACROSS: f64 = 60.0;

/// Time on either side over which heights must stay (s), and fewest rows in it.
const STAYS: f64 = 3.0;
const FEWEST: usize = 4;

/// Largest scatter on either side, as a fraction of the jump.
const SCATTER: f64 = 0.2;

/// Jumps beyond which a receiver has not merely found another height a few times.
const MOST: usize = 4;

/// Share of rows that leap, whether or not they stay there, above which they are not one track.
const LEAPS: f64 = 0.05;

/// Moves the rows before each jump along some axes so that they meet those after it, which end on the ground. Returns
/// whether the channel can be trusted: those of two tracks in one file jump to and fro.
pub(super) fn checked(
    samples: &mut [Sample],
    axes: &[usize],
    [places, velocities]: [Channel; 2],
    findings: &mut Vec<Finding>,
) -> bool {
    let least = match places {
        Channel::Height => JUMPS,
        _ => JUMPS_ACROSS,
    };
    let left = without_velocities(samples, axes);
    let gap = longest_step(samples);
    let mut jumps = Vec::new();
    let mut leaps = Vec::new();
    for index in 1..left.len() {
        let [before, after] = [left[index - 1], left[index]];
        let jump = after.position - before.position;
        let size = jump.norm();
        if size <= least || after.time - before.time > gap {
            continue;
        }
        leaps.push((index, jump));
        let earlier = between(&left, [before.time - STAYS, before.time]);
        let later = between(&left, [after.time, after.time + STAYS]);
        if stays(earlier, &before, size) && stays(later, &after, size) {
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
            sample.position += jump;
        }
    }
    let largest = jumps
        .iter()
        .max_by(|(_, a), (_, b)| a.norm().total_cmp(&b.norm()));
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
    // Heights jump up or down, positions anywhere.
    let by = match axes {
        [axis] => jump[*axis],
        _ => jump.norm(),
    };
    findings.push(Finding {
        channel: places,
        remedy: if is_trusted {
            Remedy::Converted
        } else {
            Remedy::Reported
        },
        sentence: format!(
            "the {} jump by {by:.0} m at {:.1} s{times}, and the {} do not: {then}",
            places.name(),
            samples[*index].time - first.time,
            velocities.name()
        ),
    });
    is_trusted
}

/// The samples with positions along some axes alone, less what the velocities explain.
fn without_velocities(samples: &[Sample], axes: &[usize]) -> Vec<Sample> {
    let gap = longest_step(samples);
    let mut left = samples.to_vec();
    for sample in &mut left {
        sample.position = Vector3::zeros();
    }
    for &axis in axes {
        let displacements = displacements(samples, axis, gap);
        for ((left, sample), displacement) in left.iter_mut().zip(samples).zip(displacements) {
            left.position[axis] = sample.position[axis] - displacement;
        }
    }
    left
}

/// Whether the rows lie around a place, up to a fraction of a jump of this size (m).
fn stays(rows: &[Sample], place: &Sample, size: f64) -> bool {
    let apart = rows
        .iter()
        .map(|row| (row.position - place.position).norm());
    rows.len() >= FEWEST && median(apart).is_some_and(|apart| apart < SCATTER * size)
}
