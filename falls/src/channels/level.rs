//! The level from which heights are counted, on which the density of the air depends.

use super::compare::{Channel, Finding, Remedy};
use crate::Sample;

/// Lowest height above the sea (m) with a margin for barometers in bad weather: the lowest land is at -430 m.
const LOWEST: f64 = -800.0;

/// Whether the heights can be those above the sea, or above ground near it.
pub(super) fn checked(samples: &[Sample], findings: &mut Vec<Finding>) -> bool {
    let lowest = samples
        .iter()
        .map(Sample::height)
        .fold(f64::INFINITY, f64::min);
    let is_possible = samples.is_empty() || lowest > LOWEST;
    if !is_possible {
        findings.push(Finding {
            channel: Channel::Height,
            remedy: Remedy::Reported,
            sentence: format!(
                "the heights go down to {lowest:.0} m, and no land is below -430 m: they are not counted from the sea, and densities and drag areas by them are wrong"
            ),
        });
    }
    is_possible
}
