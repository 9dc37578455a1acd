//! Faults of one sensor that can be planted.

use bodyflight_core::Segment;
use bodyflight_core::math::rotation_by;
use bodyflight_io::diagnostic::{Problem, Result};
use nalgebra::{UnitQuaternion, Vector3};

use super::errors::Row;

/// A fault of one sensor. Times are those of the flight (s); they are negative before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Fault {
    /// It is worn where another sensor should be, and that one in its place.
    Exchanged(Segment),
    /// It is turned end for end from this time on, within a duration (s).
    Reversed(f64, f64),
    /// It turns about the segment from this time on, by an angle (rad), as a strap does.
    Slipped(f64, f64),
    /// No samples from this time on.
    Dead(f64),
    /// Rates in the flight are cut off at this value (rad/s).
    Saturated(f64),
    /// Its clock is late by so much (s).
    Late(f64),
    /// Its X axis points the wrong way: its axes are left-handed.
    Mirrored,
}

/// Names of faults, what their number is, its default, and its range.
const NAMES: [(&str, &str, f64, [f64; 2]); 6] = [
    (
        "reversed",
        "time of the flight (s)",
        -6.0,
        [-1000.0, 1000.0],
    ),
    ("slipped", "time of the flight (s)", 3.0, [-1000.0, 1000.0]),
    ("dead", "time of the flight (s)", 5.0, [-1000.0, 1000.0]),
    ("saturated", "range (deg/s)", 100.0, [1.0, 1e5]),
    ("late", "delay (s)", 0.06, [-10.0, 10.0]),
    ("mirrored", "", 0.0, [0.0, 0.0]),
];
/// Angle of a slip (rad).
const SLIP: f64 = 1.2;
/// Time that a slip, and usually a turn end for end, takes (s).
const SLIPPING: f64 = 0.3;

impl Fault {
    /// Reads a fault: `l_thigh:slipped=3`, `l_thigh:exchanged=l_shank`; a number may be omitted.
    ///
    /// # Errors
    /// Returns an error if it is none.
    pub fn parse(text: &str) -> Result<(Segment, Self)> {
        let problem = || {
            let names = NAMES.map(|(name, ..)| name).join(", ");
            Problem::bad_input(format!(
                "expected SEGMENT:FAULT or SEGMENT:FAULT=VALUE, with a fault out of exchanged, {names}, found {text:?}"
            ))
            .help("l_thigh:exchanged=l_shank, l_thigh:slipped=3, r_shank:late=0.06")
        };
        let segment = |name: &str| {
            let names = Segment::ALL.map(Segment::name);
            Segment::from_name(name).ok_or_else(|| Problem::unknown("segment", name, names))
        };
        let (of, fault) = text.split_once(':').ok_or_else(problem)?;
        let of = segment(of)?;
        let (name, value) = match fault.split_once('=') {
            Some((name, value)) => (name, Some(value)),
            None => (fault, None),
        };
        if name == "exchanged" {
            let other = segment(value.ok_or_else(problem)?)?;
            if other == of {
                return Err(Problem::bad_input(format!(
                    "expected another segment to exchange {} with, found itself",
                    of.name()
                )));
            }
            return Ok((of, Self::Exchanged(other)));
        }
        let (_, what, default, [low, high]) =
            *(NAMES.iter().find(|(known, ..)| *known == name)).ok_or_else(problem)?;
        let number = match value {
            None => default,
            Some(value) => value
                .parse()
                .ok()
                .filter(|v: &f64| (low..=high).contains(v))
                .ok_or_else(|| {
                    Problem::bad_input(format!(
                        "expected {name}={what} of {low} to {high}, found {value:?}"
                    ))
                })?,
        };
        let fault = match name {
            "reversed" => Self::Reversed(number, SLIPPING),
            "slipped" => Self::Slipped(number, SLIP),
            "dead" => Self::Dead(number),
            "saturated" => Self::Saturated(number.to_radians()),
            "late" => Self::Late(number),
            _ => Self::Mirrored,
        };
        Ok((of, fault))
    }

    /// How far the sensor has turned on its segment at a time of the flight (s), in the segment's axes.
    pub(super) fn turn(self, time: f64) -> UnitQuaternion<f64> {
        let (axis, from, duration, angle) = match self {
            Self::Slipped(from, angle) => (Vector3::z(), from, SLIPPING, angle),
            Self::Reversed(from, duration) => (Vector3::y(), from, duration, std::f64::consts::PI),
            _ => return UnitQuaternion::identity(),
        };
        let share = ((time - from) / duration).clamp(0.0, 1.0);
        rotation_by(&(axis * (angle * share * share * (3.0 - 2.0 * share))))
    }

    /// Whether there is no sample at a time of the flight (s).
    pub(super) fn is_silent(self, time: f64) -> bool {
        matches!(self, Self::Dead(from) if time >= from)
    }

    /// What becomes of a sample at a time of the flight (s).
    pub(super) fn of_row(self, (stamp, rate, force): Row, time: f64) -> Row {
        let mirrored = |vector: Vector3<f64>| Vector3::new(-vector.x, vector.y, vector.z);
        match self {
            Self::Saturated(limit) if time >= 0.0 => {
                (stamp, rate.map(|part| part.clamp(-limit, limit)), force)
            }
            Self::Late(by) => (stamp + by, rate, force),
            Self::Mirrored => (stamp, mirrored(rate), mirrored(force)),
            _ => (stamp, rate, force),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_and_anything_else_is_refused() {
        let read = |text: &str| Fault::parse(text).map_err(|problem| problem.to_string());
        let (thigh, shank) = (Segment::LeftThigh, Segment::LeftShank);
        assert_eq!(
            read("l_thigh:exchanged=l_shank"),
            Ok((thigh, Fault::Exchanged(shank)))
        );
        assert_eq!(read("l_shank:late=0.05"), Ok((shank, Fault::Late(0.05))));
        assert_eq!(read("l_shank:dead"), Ok((shank, Fault::Dead(5.0))));
        for (text, part) in [
            ("l_thigh", "SEGMENT:FAULT"),
            ("tail:dead", "tail"),
            ("l_thigh:lost", "\"l_thigh:lost\""),
            ("l_thigh:late=soon", "late=delay (s)"),
            ("l_thigh:late=1e9", "late=delay (s) of -10 to 10"),
            ("l_thigh:slipped=1e9", "of -1000 to 1000"),
            (
                "l_thigh:saturated=0",
                "saturated=range (deg/s) of 1 to 100000",
            ),
            ("l_thigh:exchanged=l_thigh", "found itself"),
            ("l_thigh:exchanged", "exchanged"),
        ] {
            let said = read(text).unwrap_err();
            assert!(said.contains(part), "{text}: {said}");
        }
    }
}
