//! Whether something carries the body of a recording: the model is that of a body that falls.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_mvnx::recording::{FlightFrame, Warning};
use nalgebra::Vector3;

/// Length of the pieces that are judged (s).
const PIECE: f64 = 0.5;
/// Speed through the air below which drag is less than a thirtieth of the weight (m/s).
const SPEED: f64 = 8.0;
/// Speed against the air along the vertical (m/s) below which a body that moves fast does not fall, under a wingsuit neither.
const SINKS: f64 = 4.0;
/// Share of gravity that no body exceeds downwards on average over a piece, and the fewest such pieces.
const PULLED: f64 = 1.5;
const LEAST_PULLED: u32 = 2;
/// Share of gravity that a body without support exceeds on average over a piece.
const FALLS: f64 = 0.5;
/// Share of the time with support above which a recording is not one of a fall, and the least such time (s).
const SHARE: f64 = 0.3;
const LEAST: f64 = 1.0;

/// Time with and without support.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Support {
    air: Vector3<f64>,
    begin: Option<(f64, Vector3<f64>)>,
    judged: f64,
    carried: f64,
    /// Part of that time in which it moves fast, and the largest speed (m/s).
    level: f64,
    fastest: f64,
    /// Pieces in which it falls faster than gravity lets it, and the first: index, time (s) and acceleration (m/s2).
    pulled: u32,
    first_pulled: Option<(u64, f64, f64)>,
    first: Option<(u64, f64)>,
    last: f64,
}

impl Support {
    /// Air that moves at this velocity (m/s, inertial).
    pub(crate) fn in_air(velocity: [f64; 3]) -> Self {
        Self {
            air: velocity.into(),
            ..Self::default()
        }
    }

    pub(crate) fn see(&mut self, frame: &FlightFrame) {
        let Some(velocity) = frame.pelvis.velocity else {
            return;
        };
        let now = velocity.components;
        let (begin, before) = *self.begin.get_or_insert((frame.time, now));
        let duration = frame.time - begin;
        if duration < PIECE {
            return;
        }
        self.begin = Some((frame.time, now));
        if duration > 2.0 * PIECE {
            return;
        }
        let flow = 0.5 * (before + now) - self.air;
        let falls_with = (before.z - now.z) / duration;
        if falls_with > PULLED * STANDARD_GRAVITY {
            self.pulled += 1;
            let here = (frame.index, begin, falls_with);
            self.first_pulled.get_or_insert(here);
        }
        self.judged += duration;
        let is_slow = flow.norm() < SPEED;
        if falls_with < FALLS * STANDARD_GRAVITY && (is_slow || -flow.z < SINKS) {
            self.carried += duration;
            if !is_slow {
                self.level += duration;
                self.fastest = self.fastest.max(flow.norm());
            }
            self.first.get_or_insert((frame.index, begin));
            self.last = frame.time;
        }
    }

    /// Contradictions if the recording is not that of a fall.
    pub(crate) fn warnings(&self) -> Vec<Warning> {
        self.carries().into_iter().chain(self.pulls()).collect()
    }

    fn pulls(&self) -> Option<Warning> {
        let (frame, begin, falls_with) =
            self.first_pulled.filter(|_| self.pulled >= LEAST_PULLED)?;
        Some(Warning {
            frame,
            message: format!(
                "the body falls with {falls_with:.0} m/s2 for {PIECE} s, {} times in all; gravity gives {STANDARD_GRAVITY:.1}: positions are not in metres, or the frame rate is wrong",
                self.pulled
            ),
            segment: None,
            span_s: Some([begin, begin + PIECE]),
            is_fault: true,
        })
    }

    fn carries(&self) -> Option<Warning> {
        let (frame, from) = self.first?;
        let percent = 100.0 * self.carried / self.judged.max(f64::MIN_POSITIVE);
        let message = if self.level > 0.5 * self.carried {
            format!(
                "for {percent:.0} % of the time the body travels at up to {:.0} m/s without falling: something carries it, as an aircraft does, or another axis than the third points up",
                self.fastest
            )
        } else {
            format!(
                "for {percent:.0} % of the time something carries the body, which neither falls nor meets an airflow of \
                 {SPEED} m/s: it is on the ground, in an aircraft, or in a wind tunnel whose air [air] velocity does not state"
            )
        };
        (percent > 100.0 * SHARE && self.carried >= LEAST).then_some(Warning {
            frame,
            message,
            segment: None,
            span_s: Some([from, self.last]),
            is_fault: true,
        })
    }
}
