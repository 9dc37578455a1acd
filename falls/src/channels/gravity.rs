//! Gravity as a measure of length: nothing that falls gains speed faster.
//!
//! Heights in feet with velocities in feet per second agree with each other, and heights alone have nothing to be
//! compared with. But after the exit the speed grows by 9.8 m/s each second at most.

use bodyflight_core::air::GRAVITY;

use super::compare::{Channel, FOOT, Finding, Remedy};
use crate::{Sample, between, longest_step, median};

/// Time before and after a moment at which speeds are compared (s): medians from one to three seconds away.
const AWAY: [f64; 2] = [1.0, 3.0];

/// Accelerations, in multiples of gravity, that show feet: a fall that gathers speed gains it at 0.6 to 1.1 g.
const FEET: [f64; 2] = [1.9, 3.7];

/// Accelerations of a channel that is wrong, in multiples of gravity; larger ones are single wrong fixes.
const IMPOSSIBLE: [f64; 2] = [1.5, 6.0];

/// Sink speed that no fall without an exit on the track has (m/s): the fastest speed skydivers reach 150 m/s.
const FASTEST: f64 = 160.0;

/// Compares the gain of speed with gravity; converts feet. Returns whether the track is possible.
pub(super) fn checked(samples: &mut [Sample], findings: &mut Vec<Finding>) -> bool {
    let gains = gains(samples) / GRAVITY;
    if (FEET[0]..FEET[1]).contains(&gains) {
        for sample in samples.iter_mut() {
            sample.position.z *= FOOT;
            sample.velocity.z *= FOOT;
        }
        findings.push(Finding {
            channel: Channel::Height,
            remedy: Remedy::Converted,
            sentence: format!(
                "the fall gains speed at {gains:.1} times gravity: heights and vertical velocities are in feet, and are \
                 converted to metres"
            ),
        });
        return true;
    }
    let fastest = fastest(samples);
    if is_impossible(gains) || (fastest > FASTEST && gains < 0.5) {
        findings.push(Finding {
            channel: Channel::VerticalVelocity,
            remedy: Remedy::Reported,
            sentence: format!(
                "{fastest:.0} m/s downwards, gained at up to {gains:.1} times gravity, is not possible: the unit of the heights \
                 or of the clock is wrong, and it is not certain which"
            ),
        });
        return false;
    }
    true
}

/// Whether the fall gains speed faster than gravity allows.
pub(super) fn is_too_fast(samples: &[Sample]) -> bool {
    is_impossible(gains(samples) / GRAVITY)
}

/// Whether a gain of speed, in multiples of gravity, is that of a wrong channel.
fn is_impossible(gains: f64) -> bool {
    (IMPOSSIBLE[0]..IMPOSSIBLE[1]).contains(&gains)
}

/// The largest speed downwards that is kept for a while (m/s).
fn fastest(samples: &[Sample]) -> f64 {
    let parts = samples.chunks(5);
    let sinks = parts.filter_map(|part| median(part.iter().map(|sample| -sample.velocity.z)));
    sinks.fold(0.0, f64::max)
}

/// The largest gain of downward speed (m/s2) over some seconds, which a few wrong fixes do not change.
fn gains(samples: &[Sample]) -> f64 {
    let gap = longest_step(samples);
    let mut most = 0.0_f64;
    for run in samples.chunk_by(|before, after| after.time - before.time <= gap) {
        let sink = |from: f64, to: f64| {
            let part = between(run, [from, to]);
            (part.len() >= 3).then(|| median(part.iter().map(|sample| -sample.velocity.z)))?
        };
        for sample in run {
            let before = sink(sample.time - AWAY[1], sample.time - AWAY[0]);
            let after = sink(sample.time + AWAY[0], sample.time + AWAY[1]);
            if let (Some(before), Some(after)) = (before, after)
                && is_steady(run, sample.time)
            {
                most = most.max((after - before) / (AWAY[0] + AWAY[1]));
            }
        }
    }
    most
}

/// Largest deviation of speeds from a line (root mean square), as a fraction of the change over it: wrong fixes jump.
const STRAIGHT: f64 = 0.1;

/// Whether the downward speed around a time (s) grows steadily.
fn is_steady(run: &[Sample], time: f64) -> bool {
    let part = between(run, [time - AWAY[1], time + AWAY[1]]);
    if part.len() <= 3 {
        return false;
    }
    let count = part.len() as f64;
    let mean = |of: &dyn Fn(&Sample) -> f64| part.iter().map(of).sum::<f64>() / count;
    let (time, speed) = (
        mean(&|sample| sample.time),
        mean(&|sample| sample.velocity.z),
    );
    let spread = mean(&|sample| (sample.time - time).powi(2));
    let slope = mean(&|sample| (sample.time - time) * (sample.velocity.z - speed)) / spread;
    let off = mean(&|sample| (sample.velocity.z - speed - slope * (sample.time - time)).powi(2));
    off.sqrt() < STRAIGHT * (slope * 2.0 * AWAY[1]).abs()
}
