//! Heights against vertical velocities.

use super::compare::{
    Channel, FEWEST, FOOT, Finding, MOVES, Remedy, SPEEDS, displacement, is_alike, windows,
};
use super::derived::velocities;
use super::{gravity, late};
use crate::{Sample, median};

/// Share of the moving windows of one channel in which the other moves, below which it does not follow.
const FOLLOWS: f64 = 0.1;

/// Largest factor between the channels, or one divided by it, at which neither of them is preferred.
const ALMOST: f64 = 1.35;

/// Largest such factor that poor reception has, too, and that leaves the rest of the analysis as it is.
const SLIGHT: f64 = 1.1;

/// Share of the moving windows in which a channel must go the other way for its sign to be doubted, and of those that
/// the rest must be.
const AGAINST: f64 = 0.05;

/// Number of windows that are long enough for the sign of a slow climb.
const LONG: usize = 5;

/// What became of the vertical channels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Vertical {
    /// The velocities are measured ones.
    Measured,
    /// The velocities are derived from the heights.
    Derived,
    /// One of both channels is wrong, and it is not certain which.
    Doubted,
}

/// Compares heights with vertical velocities; converts or replaces the one that is wrong.
pub(super) fn checked(samples: &mut [Sample], findings: &mut Vec<Finding>) -> Vertical {
    let mut pairs = pairs(samples);
    let [by_height, by_velocity] = [0, 1].map(|place: usize| {
        pairs
            .iter()
            .filter(|pair| pair[place].abs() > MOVES)
            .count()
    });
    if by_height.max(by_velocity) < FEWEST {
        return Vertical::Measured;
    }
    let follows = |other: usize, one: usize| other as f64 >= FOLLOWS * one as f64;
    if !follows(by_height, by_velocity) {
        findings.push(Finding {
            channel: Channel::Height,
            remedy: Remedy::NotUsed,
            sentence: "the heights hardly change while the vertical velocities do: they are not used; heights \
                       are integrated from the velocities, above the lowest point of the track"
                .to_owned(),
        });
        integrate(samples);
        return Vertical::Measured;
    }
    if has_no_sign(samples, &pairs) {
        findings.push(converted(
            Channel::VerticalVelocity,
            "the vertical velocities have no sign: they get that of the change of height",
        ));
        sign(samples);
        pairs = self::pairs(samples);
    }
    let mut ratio = ratio(&pairs);
    // In a fall that gathers speed, a late channel looks like one with another scale.
    if ratio.is_some_and(|ratio| (1.0 / ALMOST..ALMOST).contains(&ratio) && !is_alike(ratio, 1.0)) {
        let vertical = [Channel::Height, Channel::VerticalVelocity];
        if late::checked(samples, &[2], vertical, findings) == late::Timing::Doubted {
            return Vertical::Doubted;
        }
        ratio = self::ratio(&self::pairs(samples));
    }
    let Some(ratio) = ratio.filter(|_| follows(by_velocity, by_height)) else {
        let shares = pairs.iter().filter(|pair| pair[0].abs() > MOVES);
        let share = median(shares.map(|pair| pair[1] / pair[0])).unwrap_or(0.0);
        findings.push(not_used(share));
        replace(samples);
        return Vertical::Derived;
    };
    mended(samples, ratio, findings)
}

/// Changes of height by the heights and by the vertical velocities, in windows.
fn pairs(samples: &[Sample]) -> Vec<[f64; 2]> {
    windows(samples)
        .into_iter()
        .map(|window| {
            let [first, last] = window;
            [
                samples[last].height() - samples[first].height(),
                displacement(samples, window).z,
            ]
        })
        .collect()
}

/// Heights over velocities in the fastest third of the moving windows, where a drift matters least.
fn ratio(pairs: &[[f64; 2]]) -> Option<f64> {
    let mut moving: Vec<&[f64; 2]> = pairs.iter().filter(|pair| pair[1].abs() > MOVES).collect();
    moving.sort_by(|a, b| b[1].abs().total_cmp(&a[1].abs()));
    moving.truncate((moving.len() / 3).max(FEWEST));
    median(moving.into_iter().map(|pair| pair[0] / pair[1]))
}

/// Whether the velocities all have one sign while the heights rise and fall.
fn has_no_sign(samples: &[Sample], pairs: &[[f64; 2]]) -> bool {
    let values = || samples.iter().map(|sample| sample.velocity.z);
    if !values().all(|value| value >= 0.0) && !values().all(|value| value <= 0.0) {
        return false;
    }
    let long: Vec<[f64; 2]> = pairs
        .chunks(LONG)
        .map(|part| [0, 1].map(|place: usize| part.iter().map(|pair| pair[place]).sum()))
        .collect();
    let moving = || {
        let moves = |pair: &&[f64; 2]| pair.iter().all(|displacement| displacement.abs() > MOVES);
        long.iter().filter(moves)
    };
    let against = moving().filter(|pair| pair[0] * pair[1] < 0.0).count() as f64;
    let share = against / moving().count().max(1) as f64;
    (AGAINST..=1.0 - AGAINST).contains(&share)
}

/// Gives velocities the sign of those derived from the heights.
fn sign(samples: &mut [Sample]) {
    let derived = velocities(samples);
    for (sample, velocity) in samples.iter_mut().zip(derived) {
        sample.velocity.z = sample.velocity.z.abs().copysign(velocity.z);
    }
}

/// Mends channels of which one is `ratio` times the other.
fn mended(samples: &mut [Sample], ratio: f64, findings: &mut Vec<Finding>) -> Vertical {
    if is_alike(ratio, -1.0) {
        findings.push(converted(
            Channel::VerticalVelocity,
            "the vertical velocities have the opposite sign of the change of height: they are turned round",
        ));
        scale(samples, 1.0, -1.0);
        return Vertical::Measured;
    }
    let combinations = [("", 1.0), ("feet", FOOT)].into_iter().flat_map(|height| {
        let speeds = SPEEDS.iter().map(|unit| (unit.name, unit.factor));
        core::iter::once(("", 1.0))
            .chain(speeds)
            .map(move |speed| (height, speed))
    });
    // Two units at once may look like none, which only gravity tells: feet and feet per second, which it is asked
    // later, or feet and kilometres per hour.
    let is_too_fast = gravity::is_too_fast(samples);
    let nearest = combinations
        .filter(|(height, speed)| is_alike(ratio, speed.1 / height.1))
        .filter(|(height, speed)| {
            let is_near_none = (1.0 / ALMOST..ALMOST).contains(&(speed.1 / height.1));
            let is_none = height.0.is_empty() && speed.0.is_empty();
            is_none || !is_near_none || (is_too_fast && !is_alike(speed.1 / height.1, 1.0))
        })
        .min_by(|a, b| {
            let off = |(height, speed): &((&str, f64), (&str, f64))| {
                (ratio * height.1 / speed.1).ln().abs()
            };
            off(a).total_cmp(&off(b))
        });
    if let Some(((height, metres), (speed, factor))) = nearest {
        let said = format!("heights and vertical velocities disagree by a factor of {ratio:.2}");
        if metres < 1.0 {
            findings.push(converted(
                Channel::Height,
                &format!("{said}: the heights are in {height}, and are converted to metres"),
            ));
            scale(samples, metres, 1.0);
        }
        if factor < 1.0 {
            findings.push(converted(
                Channel::VerticalVelocity,
                &format!(
                    "{said}: the vertical velocities are in {speed}, and are converted to metres per second"
                ),
            ));
            scale(samples, 1.0, factor);
        }
        return Vertical::Measured;
    }
    // Noise makes two units look like one that is a little off.
    if (1.0 / ALMOST..ALMOST).contains(&ratio) {
        findings.push(Finding {
            channel: Channel::VerticalVelocity,
            remedy: Remedy::Reported,
            sentence: format!(
                "heights and vertical velocities disagree by a factor of {ratio:.2}: one of them is wrong, and it is not \
                 certain which"
            ),
        });
        return if (1.0 / SLIGHT..SLIGHT).contains(&ratio) {
            Vertical::Measured
        } else {
            Vertical::Doubted
        };
    }
    findings.push(not_used(1.0 / ratio));
    replace(samples);
    Vertical::Derived
}

fn converted(channel: Channel, sentence: &str) -> Finding {
    Finding {
        channel,
        remedy: Remedy::Converted,
        sentence: sentence.to_owned(),
    }
}

fn not_used(share: f64) -> Finding {
    Finding {
        channel: Channel::VerticalVelocity,
        remedy: Remedy::NotUsed,
        sentence: format!(
            "the vertical velocities are {share:.2} of what the heights say: they are not used; velocities are derived \
             from the heights"
        ),
    }
}

fn scale(samples: &mut [Sample], height: f64, velocity: f64) {
    for sample in samples {
        sample.position.z *= height;
        sample.velocity.z *= velocity;
    }
}

/// Replaces the vertical velocities by those of the heights.
fn replace(samples: &mut [Sample]) {
    let derived = velocities(samples);
    for (sample, velocity) in samples.iter_mut().zip(derived) {
        sample.velocity.z = velocity.z;
    }
}

/// Replaces the heights by the integral of the vertical velocities, with the lowest one as zero.
fn integrate(samples: &mut [Sample]) {
    let (mut height, mut lowest) = (0.0, 0.0_f64);
    for index in 0..samples.len() {
        if let Some(before) = index.checked_sub(1).map(|before| samples[before]) {
            let own = samples[index];
            height += 0.5 * (before.velocity.z + own.velocity.z) * (own.time - before.time);
        }
        lowest = lowest.min(height);
        samples[index].position.z = height;
    }
    for sample in samples {
        sample.position.z -= lowest;
    }
}
