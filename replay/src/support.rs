//! Whether something carries the body of a recording: the model is that of a body that falls.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_mvnx::recording::{FlightFrame, Warning};
use nalgebra::Vector3;

/// Length of the pieces that are judged (s).
const PIECE: f64 = 0.5;
/// Speed through the air below which drag is less than a thirtieth of the weight (m/s).
const SPEED: f64 = 8.0;
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
        let speed = (0.5 * (before + now) - self.air).norm();
        let falls = (before.z - now.z) / duration > FALLS * STANDARD_GRAVITY;
        self.judged += duration;
        if speed < SPEED && !falls {
            self.carried += duration;
            self.first.get_or_insert((frame.index, begin));
            self.last = frame.time;
        }
    }

    /// A contradiction if the recording is not that of a fall.
    pub(crate) fn warning(&self) -> Option<Warning> {
        let (frame, from) = self.first?;
        let share = self.carried / self.judged.max(f64::MIN_POSITIVE);
        (share > SHARE && self.carried >= LEAST).then(|| Warning {
            frame,
            message: format!(
                "for {:.0} % of the time something carries the body, which neither falls nor meets an airflow of \
                 {SPEED} m/s: it is on the ground, in an aircraft, or in a wind tunnel whose air [air] velocity does not state",
                100.0 * share
            ),
            segment: None,
            span_s: Some([from, self.last]),
            is_fault: true,
        })
    }
}
