//! Sensors that were exchanged: with which assignment neighbours feel the same force at their joints.
//!
//! Poses alone do not tell a thigh from a shank, nor left from right. But a sensor on the shank feels what the knee does.
//! Forces tell as well that thigh and shank are of different sides, but not which of them is on the wrong one: that follows
//! from the march, which begins with the left knee and the right hand.

use bodyflight_core::suit::set::{Fitted, Suit, pairs_of};
use bodyflight_core::{Body, Posture, Segment};
use nalgebra::Vector3;

use super::calibration::calibrated;
use super::mapping::ImuMapping;
use super::stream::Stream;
use super::windows::Found;

/// Rate at which assignments are tried (Hz).
const RATE: f64 = 60.0;
/// Share of the mismatch that remains if two sensors are exchanged, from which they are.
const BETTER: f64 = 0.75;
/// Least mismatch that is worth an explanation.
const LEAST_MISFIT: f64 = 0.01;

/// Share of its greatest value from which a swing is the first.
const FIRST: f64 = 0.4;
/// Least difference of the angles of both sides in the march from which their order follows (rad).
const LEAST_SWING: f64 = 0.15;
/// Segments on the left that swing in the march, and the sense of their angle about the left axis, relative to that on the
/// right, when the left knee is up.
const SWINGS: [(Segment, f64); 4] = [
    (Segment::LeftThigh, -1.0),
    (Segment::LeftShank, 1.0),
    (Segment::LeftUpperArm, 1.0),
    (Segment::LeftForearm, 1.0),
];

/// Sensors that were exchanged, in pairs, and what shows it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Exchange {
    pub(super) pairs: Vec<[Segment; 2]>,
    pub(super) why: String,
}

/// The recording up to the flight.
pub(super) struct Calibration<'a> {
    pub(super) mapping: &'a ImuMapping,
    pub(super) windows: &'a Found,
    pub(super) body: &'a Body<f64>,
}

impl Calibration<'_> {
    /// Two sensors that were exchanged, or pairs of both sides.
    pub(super) fn exchange(
        &self,
        sensors: &[(Segment, &Stream)],
        fitted: &[Fitted<f64>],
    ) -> Option<Exchange> {
        let as_said = self.misfit(sensors)?;
        let found = (as_said > LEAST_MISFIT)
            .then(|| self.best(sensors))
            .flatten()
            .filter(|(_, misfit)| *misfit < BETTER * as_said);
        let order = self
            .windows
            .march
            .map(|march| order(march, sensors, fitted));
        let wrong = order
            .unwrap_or_default()
            .into_iter()
            .filter(|(_, is_first)| !is_first);
        let wrong: Vec<[Segment; 2]> = wrong.map(|(left, _)| [left, left.mirrored()]).collect();
        let of_sides = |[one, other]: [Segment; 2]| one.mirrored() == other;
        match found {
            Some((pair, misfit)) if wrong.is_empty() || !of_sides(pair) => Some(Exchange {
                pairs: vec![pair],
                why: format!(
                    "what neighbours feel at their joints in the calibration agrees {:.1} times better then",
                    as_said / misfit
                ),
            }),
            _ if wrong.is_empty() => None,
            _ => Some(Exchange {
                pairs: wrong,
                why: "the march begins with the left knee and the right hand, and in theirs the other side comes first"
                    .to_owned(),
            }),
        }
    }

    /// The exchange of any two with which the poses show a mounting of all sensors, if they do not as it is said.
    pub(super) fn remedy(&self, sensors: &[(Segment, &Stream)]) -> Option<[Segment; 2]> {
        self.best(sensors).map(|(pair, _)| pair)
    }

    /// The exchange with the least mismatch.
    fn best(&self, sensors: &[(Segment, &Stream)]) -> Option<([Segment; 2], f64)> {
        let mut best: Option<([Segment; 2], f64)> = None;
        for [one, other] in pairs(sensors) {
            let mut exchanged = sensors.to_vec();
            (exchanged[one].1, exchanged[other].1) = (sensors[other].1, sensors[one].1);
            let Some(misfit) = self.misfit(&exchanged) else {
                continue;
            };
            if best.is_none_or(|(_, least)| misfit < least) {
                best = Some(([sensors[one].0, sensors[other].0], misfit));
            }
        }
        best
    }

    /// Mean mismatch of neighbours in bend and march; `None` if the poses do not show the mountings.
    fn misfit(&self, sensors: &[(Segment, &Stream)]) -> Option<f64> {
        let calibrated = calibrated(self.mapping, self.windows, sensors, self.body).ok()?;
        let mut suit = Suit::<f64, 16, { pairs_of(16) }>::new(
            &calibrated.fitted,
            self.body,
            &Posture::h_pose(),
        )
        .ok()?;
        let mut time = calibrated.begin_s;
        while time < calibrated.end_s {
            time += 1.0 / RATE;
            let readings: Vec<_> = sensors.iter().map(|(_, stream)| stream.at(time)).collect();
            suit.push(&readings, 1.0 / RATE);
        }
        suit.misfit()
    }
}

/// The left segments of both sides that swing in the march, and whether they swing in the right order.
fn order(
    march: [f64; 2],
    sensors: &[(Segment, &Stream)],
    fitted: &[Fitted<f64>],
) -> Vec<(Segment, bool)> {
    let swing = |segment: Segment| {
        let place = sensors.iter().position(|(worn, _)| *worn == segment)?;
        let (fitted, stream) = (fitted.get(place)?, sensors.get(place)?.1);
        let left = fitted.mounting.segment_from_sensor.inverse() * Vector3::x();
        let mut angle = 0.0;
        let angles = stream.timed(march).map(|(time, step, reading)| {
            angle += fitted
                .gyroscope
                .corrected(&reading.angular_velocity)
                .dot(&left)
                * step;
            (time, angle)
        });
        Some(angles.collect::<Vec<_>>())
    };
    let is_first = |(left, sense): (Segment, f64)| {
        let (own, other) = (swing(left)?, swing(left.mirrored())?);
        let difference = own.iter().map(|(time, angle)| {
            let after = other.partition_point(|(other, _)| other < time);
            sense * (angle - other.get(after).map_or(0.0, |(_, angle)| *angle))
        });
        let difference: Vec<f64> = difference.collect();
        let most = difference.iter().fold(0.0, |most, by| by.abs().max(most));
        let first = difference.iter().find(|by| by.abs() > FIRST * most)?;
        (most > LEAST_SWING).then_some((left, *first > 0.0))
    };
    SWINGS.into_iter().filter_map(is_first).collect()
}

/// All pairs, by their places.
fn pairs(sensors: &[(Segment, &Stream)]) -> impl Iterator<Item = [usize; 2]> {
    let count = sensors.len();
    (0..count).flat_map(move |one| (one + 1..count).map(move |other| [one, other]))
}
