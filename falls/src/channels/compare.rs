//! What comparisons of channels share: findings, windows of a track, and units that are mistaken for others.

use nalgebra::Vector3;
use serde::Serialize;

use crate::{Sample, longest_step};

/// A channel of a track.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Channel {
    /// Height.
    Height,
    /// Vertical velocity.
    VerticalVelocity,
    /// Horizontal position.
    Position,
    /// Horizontal velocity.
    HorizontalVelocity,
    /// The clock.
    Clock,
}

impl Channel {
    /// Name in a sentence, in the plural.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Height => "heights",
            Self::VerticalVelocity => "vertical velocities",
            Self::Position => "positions",
            Self::HorizontalVelocity => "horizontal velocities",
            Self::Clock => "times",
        }
    }
}

/// What was done about a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Remedy {
    /// The channel was converted to the unit, sign or axes that agree with the others.
    Converted,
    /// The channel is not used; others replace it.
    NotUsed,
    /// Nothing: it is not certain which channel is wrong.
    Reported,
}

/// A fault of a channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Finding {
    /// The channel.
    pub channel: Channel,
    /// What was done.
    pub remedy: Remedy,
    /// The fault, in a sentence.
    pub sentence: String,
}

/// Length of the windows over which positions and velocities are compared (s), and the motion within one that makes it
/// count (m).
pub(super) const WINDOW: f64 = 4.0;
pub(super) const MOVES: f64 = 12.0;

/// Fewest windows with motion for a comparison.
pub(super) const FEWEST: usize = 8;

/// Largest deviation of a ratio from one, or from that of a unit, as a fraction.
pub(super) const ALIKE: f64 = 0.05;

/// The windows of a track without missing fixes: indices of the first and the last sample of each.
pub(super) fn windows(samples: &[Sample]) -> Vec<[usize; 2]> {
    let gap = longest_step(samples);
    let mut windows = Vec::new();
    let mut first = 0;
    for index in 1..samples.len() {
        if samples[index].time - samples[index - 1].time > gap {
            first = index;
        } else if samples[index].time - samples[first].time >= WINDOW {
            windows.push([first, index]);
            first = index;
        }
    }
    windows
}

/// The displacement according to the velocities within a window (m).
pub(super) fn displacement(samples: &[Sample], [first, last]: [usize; 2]) -> Vector3<f64> {
    samples[first..=last]
        .windows(2)
        .map(|pair| (pair[0].velocity + pair[1].velocity) * (0.5 * (pair[1].time - pair[0].time)))
        .sum()
}

/// The displacement along an axis up to each sample according to the velocities (m); of steps longer than `gap` (s),
/// only as much counts.
pub(super) fn displacements(samples: &[Sample], axis: usize, gap: f64) -> Vec<f64> {
    let steps = samples.windows(2).map(|pair| {
        let mean = 0.5 * (pair[0].velocity[axis] + pair[1].velocity[axis]);
        mean * (pair[1].time - pair[0].time).min(gap)
    });
    let displacements = steps.scan(0.0, |displacement, step| {
        *displacement += step;
        Some(*displacement)
    });
    let first = samples.first().map(|_| 0.0);
    first.into_iter().chain(displacements).collect()
}

/// A unit that converters mistake for the metre or the metre per second, in it.
pub(super) struct Unit {
    pub(super) name: &'static str,
    pub(super) factor: f64,
}

/// Metres per foot.
pub(super) const FOOT: f64 = 0.3048;

pub(super) const SPEEDS: [Unit; 5] = [
    Unit {
        name: "kilometres per hour",
        factor: 1.0 / 3.6,
    },
    Unit {
        name: "knots",
        factor: 0.514_444,
    },
    Unit {
        name: "miles per hour",
        factor: 0.447_04,
    },
    Unit {
        name: "feet per second",
        factor: FOOT,
    },
    Unit {
        name: "feet per minute",
        factor: 0.005_08,
    },
];

/// The unit of speed with a factor that is alike.
pub(super) fn speed_unit(ratio: f64) -> Option<&'static Unit> {
    SPEEDS.iter().find(|unit| is_alike(ratio, unit.factor))
}

pub(super) fn is_alike(ratio: f64, other: f64) -> bool {
    (ratio / other - 1.0).abs() < ALIKE
}
