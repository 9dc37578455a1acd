//! Rows that repeat one fix: the logger wrote on while the receiver said nothing.

use super::compare::{Channel, Finding, Remedy};
use crate::Sample;

/// Shortest repetition (s) that is no slow receiver, and slowest motion (m/s) that it contradicts.
const LASTS: f64 = 2.5;
const MOVES: f64 = 5.0;

/// Leaves out rows that repeat the fix before them exactly, for a while, though it moves. `has_velocities` says whether
/// velocities were measured; otherwise repeated positions alone are rest.
pub(super) fn checked(
    samples: &mut Vec<Sample>,
    has_velocities: bool,
    findings: &mut Vec<Finding>,
) {
    let (Some(start), true) = (samples.first().map(|first| first.time), has_velocities) else {
        return;
    };
    let is_same = |a: &Sample, b: &Sample| a.position == b.position && a.velocity == b.velocity;
    let (mut kept, mut count, mut longest) = (Vec::with_capacity(samples.len()), 0, [0.0; 2]);
    for run in samples.chunk_by(is_same) {
        let [first, .., last] = run else {
            kept.extend_from_slice(run);
            continue;
        };
        let duration = last.time - first.time;
        if duration < LASTS || first.velocity.norm() < MOVES {
            kept.extend_from_slice(run);
            continue;
        }
        kept.push(*first);
        count += run.len() - 1;
        if duration > longest[1] {
            longest = [first.time - start, duration];
        }
    }
    if count == 0 {
        return;
    }
    *samples = kept;
    let [time, duration] = longest;
    findings.push(Finding {
        channel: Channel::Position,
        remedy: Remedy::NotUsed,
        sentence: format!(
            "{count} rows repeat the fix before them, from {time:.1} s on for {duration:.1} s, though it moves: they are left out"
        ),
    });
}
