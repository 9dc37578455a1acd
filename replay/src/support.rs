//! Whether something carries the body of a recording: the model is that of a body that falls.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_mvnx::recording::{FlightFrame, Warning};
use nalgebra::Vector3;

/// Airspeed (m/s) that nobody reaches with the front or the back to the wind, up to 10 km, the cosine of the angle between
/// the two from which on it is so, and the share of the time above which it is no moment of a dive.
const BROAD: f64 = 90.0;
const BROAD_COSINE: f64 = 0.8;
const BROAD_SHARE: f64 = 0.2;
/// Length of the pieces that are judged (s).
const PIECE: f64 = 0.5;
/// Acceleration by something else than gravity, over the square of the airspeed (1/m), that a body's own drag does not
/// reach: a skydiver has 0.003 to 0.006, a slow wingsuit 0.012, a canopy 0.03 and more.
const DRAG: f64 = 0.014;
/// The same below which a body falls as if there were no air, the airspeed from which on it is judged (m/s), and the least
/// time (s). The fastest speed skydivers have 0.0004.
const NO_DRAG: f64 = 0.0002;
const FAST: f64 = 40.0;
const LEAST_FAST: f64 = 2.0;
/// Share of the airspeed along the vertical below which a body that moves fast does not fall: nobody glides so flat.
const SINKS: f64 = 0.2;
/// Share of gravity that no body exceeds downwards on average over a piece, and the fewest such pieces.
const PULLED: f64 = 1.5;
const LEAST_PULLED: u32 = 2;
/// Share of gravity that a body without support exceeds on average over a piece.
const FALLS: f64 = 0.5;
/// Share of the time with support above which a recording is not one of a fall, and the least such time (s).
const SHARE: f64 = 0.3;
const LEAST: f64 = 1.0;

/// Velocities of a piece (m/s), summed over either half, whose means are less noisy than single frames.
#[derive(Debug, Clone, Copy)]
struct Piece {
    begin: f64,
    last: f64,
    halves: [(f64, Vector3<f64>, f64); 2],
}

impl Piece {
    fn new(begin: f64) -> Self {
        Self {
            begin,
            last: begin,
            halves: [(0.0, Vector3::zeros(), 0.0); 2],
        }
    }

    fn add(&mut self, time: f64, velocity: &Vector3<f64>) {
        let half = &mut self.halves[usize::from(time - self.begin >= 0.5 * PIECE)];
        half.0 += 1.0;
        half.1 += velocity;
        half.2 += time - self.begin;
        self.last = time;
    }

    /// Mean velocity (m/s) and acceleration (m/s2); `None` if a half has no frames.
    fn motion(&self) -> Option<(Vector3<f64>, Vector3<f64>)> {
        let [first, second] = self.halves;
        if first.0 < 1.0 || second.0 < 1.0 {
            return None;
        }
        let [(before, early), (after, late)] =
            [first, second].map(|(count, sum, times)| (sum / count, times / count));
        Some((0.5 * (before + after), (after - before) / (late - early)))
    }
}

/// Time with and without support.
#[derive(Debug, Clone, Copy, Default)]
pub struct Support {
    air: Vector3<f64>,
    piece: Option<Piece>,
    judged: f64,
    carried: f64,
    /// Part of that time in which it travels faster than what carries it there by drag, and the largest speed (m/s).
    level: f64,
    fastest: f64,
    /// Time at high airspeed (s), when, and sums of decelerations along it, gravity excepted, and of its squares.
    fast: f64,
    first_fast: Option<(u64, f64)>,
    last_fast: f64,
    slowed: f64,
    squares: f64,
    /// Time in which it meets the wind broadside faster than anybody, when, and the largest speed (m/s).
    broad: f64,
    first_broad: Option<(u64, f64)>,
    last_broad: f64,
    broad_speed: f64,
    /// Pieces in which it falls faster than gravity lets it, and the first: index, time (s) and acceleration (m/s2).
    pulled: u32,
    first_pulled: Option<(u64, f64, f64)>,
    first: Option<(u64, f64)>,
    last: f64,
}

impl Support {
    /// Air that moves at this velocity (m/s, inertial).
    #[must_use]
    pub fn in_air(velocity: [f64; 3]) -> Self {
        Self {
            air: velocity.into(),
            ..Self::default()
        }
    }

    /// Takes the next frame.
    pub fn see(&mut self, frame: &FlightFrame) {
        let Some(velocity) = frame.pelvis.velocity else {
            return;
        };
        let piece = self.piece.get_or_insert_with(|| Piece::new(frame.time));
        // A gap ends a piece that cannot be judged.
        if frame.time - piece.last > PIECE {
            *piece = Piece::new(frame.time);
        }
        piece.add(frame.time, &velocity.components);
        let (begin, duration) = (piece.begin, frame.time - piece.begin);
        if duration < PIECE {
            return;
        }
        let motion = piece.motion();
        *piece = Piece::new(frame.time);
        let Some((velocity, acceleration)) = motion else {
            return;
        };
        let flow = velocity - self.air;
        let falls_with = -acceleration.z;
        if falls_with > PULLED * STANDARD_GRAVITY {
            self.pulled += 1;
            let here = (frame.index, begin, falls_with);
            self.first_pulled.get_or_insert(here);
        }
        self.judged += duration;
        let lift = STANDARD_GRAVITY - falls_with;
        let is_held = lift > DRAG * flow.norm_squared();
        if flow.norm() > FAST {
            self.fast += duration;
            self.first_fast.get_or_insert((frame.index, begin));
            self.last_fast = frame.time;
            let pushed = acceleration + Vector3::z() * STANDARD_GRAVITY;
            self.slowed -= pushed.dot(&flow) / flow.norm();
            self.squares += flow.norm_squared();
        }
        let dorsal = frame.pelvis.inertial_from_body.quaternion() * Vector3::y();
        let is_broad = dorsal.dot(&flow).abs() > BROAD_COSINE * flow.norm();
        if is_broad && flow.norm() > BROAD && falls_with < FALLS * STANDARD_GRAVITY {
            self.broad += duration;
            self.first_broad.get_or_insert((frame.index, begin));
            self.last_broad = frame.time;
            self.broad_speed = self.broad_speed.max(flow.norm());
        }
        let is_level = -flow.z < SINKS * flow.norm();
        if falls_with < FALLS * STANDARD_GRAVITY && (is_held || is_level) {
            self.carried += duration;
            if !is_held {
                self.level += duration;
                self.fastest = self.fastest.max(flow.norm());
            }
            self.first.get_or_insert((frame.index, begin));
            self.last = frame.time;
        }
    }

    /// Contradictions if the recording is not that of a fall.
    pub fn warnings(&self) -> Vec<Warning> {
        let all = [
            self.carries(),
            self.pulls(),
            self.falls_freely(),
            self.falls_broadside(),
        ];
        all.into_iter().flatten().collect()
    }

    fn falls_broadside(&self) -> Option<Warning> {
        let (frame, begin) = self
            .first_broad
            .filter(|_| self.broad >= LEAST && self.broad > BROAD_SHARE * self.judged)?;
        Some(Warning {
            frame,
            message: format!(
                "for {:.1} s the body falls with its front or back to the wind at up to {:.0} m/s, where nobody is faster than {BROAD} m/s: the frame rate or the unit of the positions is wrong",
                self.broad, self.broad_speed
            ),
            segment: None,
            span_s: Some([begin, self.last_broad]),
            is_fault: true,
        })
    }

    fn falls_freely(&self) -> Option<Warning> {
        let is_free = self.fast >= LEAST_FAST && self.slowed < NO_DRAG * self.squares;
        let (frame, _) = self.first_fast.filter(|_| is_free)?;
        Some(Warning {
            frame,
            message: format!(
                "for {:.1} s the body falls faster than {FAST} m/s as if there were no air: the path is computed and not measured, or the frame rate is wrong",
                self.fast
            ),
            segment: None,
            span_s: self.first_fast.map(|(_, begin)| [begin, self.last_fast]),
            is_fault: true,
        })
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
                "for {percent:.0} % of the time something carries the body, which does not fall freely and meets too little air to be \
                 held by it: it is on the ground, in an aircraft, under a canopy, or in a wind tunnel whose air [air] velocity does not state"
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
