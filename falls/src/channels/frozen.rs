//! Rows that repeat one fix: the logger wrote on while the receiver said nothing.

use super::compare::{Channel, Finding, Remedy, displacement};
use crate::Sample;

/// Shortest repetition (s) that is no slow receiver, and slowest motion (m/s) that it contradicts.
const LASTS: f64 = 2.5;
const MOVES: f64 = 5.0;

/// Shortest time (s) in which a height stays exactly the same that is no last digit, the change (m) by velocities that it
/// contradicts, and the largest share of a track that is frozen for a while: beyond it, heights are not recorded at all.
const HEIGHT_LASTS: f64 = 10.0;
const SINKS: f64 = 30.0;
const MOST: f64 = 0.8;

/// Integrates the measured vertical velocities while the heights stay exactly the same though the body sinks or rises.
pub(super) fn heights(samples: &mut [Sample], findings: &mut Vec<Finding>) {
    let runs: Vec<usize> = samples
        .chunk_by(|a, b| (a.height() - b.height()).abs() < f64::EPSILON)
        .map(<[Sample]>::len)
        .collect();
    let (mut from, mut longest, mut by) = (0, [0.0; 2], 0.0);
    for length in runs {
        let run = from..from + length;
        from = run.end;
        let [first, last] = [samples[run.start], samples[run.end - 1]];
        let duration = last.time - first.time;
        let sinks = displacement(samples, [run.start, run.end - 1]).z;
        #[expect(clippy::cast_precision_loss, reason = "counts of rows")]
        let share = length as f64 / samples.len() as f64;
        if duration < HEIGHT_LASTS || sinks.abs() < SINKS || share > MOST {
            continue;
        }
        for index in run.start + 1..run.end {
            let step = displacement(samples, [index - 1, index]).z;
            samples[index].position.z = samples[index - 1].position.z + step;
        }
        if duration > longest[1] {
            longest = [first.time - samples[0].time, duration];
            by = sinks;
        }
    }
    let [time, duration] = longest;
    if duration > 0.0 {
        findings.push(Finding {
            channel: Channel::Height,
            remedy: Remedy::Converted,
            sentence: format!(
                "the heights stay exactly the same from {time:.1} s on for {duration:.1} s, in which the vertical velocities change them by {by:.0} m: they are integrated from these"
            ),
        });
    }
}

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
