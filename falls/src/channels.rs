//! Compares the channels of a track with each other over the whole track: positions with velocities, heights with
//! vertical velocities, the clock with the rows.
//!
//! Loggers and converters write feet as metres, knots as metres per second, zeros for what they do not measure, speeds
//! without a sign, clocks that run fast, and channels that are late or drift. Both channels of a pair describe the same
//! motion, so such a fault shows as a ratio. A channel whose unit is certain is converted, and one that contradicts the
//! others otherwise is replaced by what they say. Every such change is reported.

mod clock;
mod compare;
mod derived;
mod drift;
mod frozen;
mod gravity;
mod horizontal;
mod late;
mod level;
mod repeated;
mod step;
mod vertical;

use crate::Sample;
pub use compare::{Channel, Finding, Remedy};
pub use derived::with_velocities;
use late::Timing;
use vertical::Vertical;

/// Which quantities a track has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Given {
    /// Horizontal positions.
    pub places: bool,
    /// Measured velocities; otherwise they are derived from the positions.
    pub velocities: bool,
    /// Measured horizontal speeds, with which the velocities were derived already.
    pub speeds: bool,
}

/// How well the motion is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Whether the horizontal motion is known.
    pub has_horizontal: bool,
    /// Half of the time over which velocities are averages (s); zero if they were measured.
    pub averaged: f64,
    /// Uncertainty of times (s) after a late channel was moved.
    pub moved: f64,
    /// Whether a channel may have a wrong scale, so that no number is certain.
    pub is_doubted: bool,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            has_horizontal: true,
            averaged: 0.0,
            moved: 0.0,
            is_doubted: false,
        }
    }
}

/// A track whose channels agree.
#[derive(Debug, Clone, PartialEq)]
pub struct Checked {
    /// The samples, with channels converted or replaced.
    pub samples: Vec<Sample>,
    /// The faults.
    pub findings: Vec<Finding>,
    /// How well the motion is known.
    pub motion: Motion,
}

/// Compares the channels of a track, and mends those that can be mended.
pub fn checked(samples: &[Sample], given: Given) -> Checked {
    let mut samples = samples.to_vec();
    let mut findings = Vec::new();
    let mut motion = Motion {
        has_horizontal: given.places,
        ..Motion::default()
    };
    frozen::checked(&mut samples, given.velocities, &mut findings);
    let mut is_derived = !given.velocities;
    if is_derived {
        let _ = clock::checked(&mut samples, None, &mut findings);
        if !given.speeds {
            with_velocities(&mut samples);
        }
        motion.is_doubted = !gravity::checked(&mut samples, &mut findings);
    } else {
        let is_once = repeated::checked(&samples, &mut findings);
        let is_timed = clock::checked(&mut samples, Some(given.places), &mut findings);
        frozen::heights(&mut samples, &mut findings);
        motion.has_horizontal = horizontal::checked(&mut samples, given.places, &mut findings);
        let vertical = vertical::checked(&mut samples, &mut findings);
        let is_possible = gravity::checked(&mut samples, &mut findings);
        motion.is_doubted = vertical == Vertical::Doubted || !is_possible || !is_timed;
        is_derived = vertical == Vertical::Derived;
        let (moved, is_one_track) = against_time(&mut samples, given.places, &mut findings);
        motion.moved = moved;
        motion.is_doubted |= !is_one_track || !is_once;
    }
    motion.is_doubted |= !level::checked(&samples, &mut findings);
    if is_derived {
        motion.averaged = derived::averaged(&samples);
    }
    Checked {
        samples,
        findings,
        motion,
    }
}

/// Finds channels that jump, are late or drift, as far as the units are right. Returns the uncertainty of times after that
/// (s), and whether the channels can be those of one track.
fn against_time(
    samples: &mut [Sample],
    has_places: bool,
    findings: &mut Vec<Finding>,
) -> (f64, bool) {
    let is_wrong = |of: Channel, findings: &[Finding]| {
        findings
            .iter()
            .any(|finding| finding.channel == of && finding.remedy != Remedy::Converted)
    };
    let vertical = [Channel::Height, Channel::VerticalVelocity];
    let horizontal = [Channel::Position, Channel::HorizontalVelocity];
    let mut timings = Vec::new();
    let mut is_one_track = true;
    if !vertical.iter().any(|of| is_wrong(*of, findings)) {
        is_one_track = step::checked(samples, &[2], vertical, findings);
        timings.push(late::checked(samples, &[2], vertical, findings));
        drift::checked(samples, has_places, findings);
    }
    if has_places && !horizontal.iter().any(|of| is_wrong(*of, findings)) {
        // A receiver in an aircraft may find its place again and again.
        let _ = step::checked(samples, &[0, 1], horizontal, findings);
        timings.push(late::checked(samples, &[0, 1], horizontal, findings));
    }
    let is_moved = timings.contains(&Timing::Moved);
    (
        if is_moved { late::UNCERTAIN } else { 0.0 },
        is_one_track && !timings.contains(&Timing::Doubted),
    )
}

#[cfg(test)]
mod tests;
