//! Attitude of a sensor that measures angular velocity and specific force only.
//!
//! While the sensor lies or stands still, its specific force points up, and what its gyroscope reads is its bias. From
//! then on the angular velocity is integrated. The attitude is never corrected towards the specific force in flight, which
//! points along the force of the air there and not up. A receiver's velocity tells what part of it is that of the motion,
//! and so corrects the attitude ([`super::aiding`]). Without one the heading is that of a magnetometer
//! ([`super::compass`]) or, without that too, relative: it is zero where the sensor was level first. With a receiver it is
//! unknown until it has been found, and the attitude is no measurement as long as it is not.

use bodyflight_core::Lanes;
use bodyflight_core::math::{normalized, small_rotation};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::aiding::{Aiding, STANDARD_GRAVITY, Seen};
use super::compass::Compass;

/// The most by which an accelerometer at rest may differ from standard gravity (m/s2).
const GRAVITY_ERROR: f32 = 0.5;

/// Largest bias of a gyroscope (rad/s).
const LARGEST_BIAS: f32 = 0.1;

/// Largest change of angular velocity (rad/s) and specific force (m/s2) of a sensor that is still. Nobody is in the air.
const STILL_TURN: f32 = 0.03;
const STILL_FORCE: f32 = 0.3;

/// How long a sensor must be still (s).
const STILL: f32 = 1.0;

/// Error of the bias (rad/s) and of the scale of a gyroscope, and the attitude error (rad) beyond which the integrated
/// attitude is no measurement any more.
const DRIFT: f32 = 0.002;
const SCALE: f32 = 0.01;
const TRUSTED: f32 = 0.06;

/// The same of the heading, which is found less well (rad).
pub(super) const TRUSTED_HEADING: f32 = 0.1;

/// Error of an attitude that a receiver has just corrected, at least (rad).
const LEAST: f32 = 0.01;

/// Longest time without a measurement over which the attitude is kept (s).
const LONGEST_GAP: f32 = 0.25;

/// Means over the time for which the sensor was still.
#[derive(Debug, Clone, Copy)]
struct Rest {
    turn: Vector3<f32>,
    force: Vector3<f32>,
    count: f32,
    time: f32,
}

/// The attitude after a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Attitude {
    pub(super) inertial_from_sensor: UnitQuaternion<f32>,
    /// Angular velocity, without the bias if it is known (rad/s, sensor axes).
    pub(super) turn: Option<Vector3<f32>>,
    /// Whether it is measured, and not only integrated since it was.
    pub(super) is_measured: bool,
    /// Error of its heading against the north of a receiver's velocity (rad).
    pub(super) heading_error: f32,
    /// Whether it had another heading before.
    pub(super) north_found: bool,
    /// Whether it is integrated from where the sensor was level, with the errors that add up meanwhile.
    pub(super) is_levelled: bool,
    /// Whether the sensor lies or stands still.
    pub(super) is_still: bool,
}

/// Integrates the attitude.
#[derive(Debug, Clone, Copy)]
pub(super) struct Level {
    inertial_from_sensor: UnitQuaternion<f32>,
    bias: Vector3<f32>,
    /// Bound of the attitude's error (rad): infinite until the sensor has been still.
    error: f32,
    /// Bound of the heading's error (rad) relative to north: infinite until it has been found. Nobody asks for it as long as
    /// there is no receiver.
    heading_error: f32,
    aiding: Aiding,
    has_receiver: bool,
    compass: Compass,
    /// Whether the receiver has told more of the heading since the field was last compared with it.
    heading_told: bool,
    /// Whether the heading has been found since the last measurement.
    north_found: bool,
    rest: Option<Rest>,
    /// Time of the last measurement in ticks of 0.1 ms.
    last: Option<u32>,
}

impl Default for Level {
    fn default() -> Self {
        Self {
            inertial_from_sensor: UnitQuaternion::identity(),
            bias: Vector3::zeros(),
            error: f32::INFINITY,
            heading_error: f32::INFINITY,
            aiding: Aiding::default(),
            has_receiver: false,
            compass: Compass::default(),
            heading_told: false,
            north_found: false,
            rest: None,
            last: None,
        }
    }
}

impl Level {
    /// Takes in angular velocity (rad/s), specific force (m/s2) and, if it is measured, the magnetic field (any unit) at
    /// `time`, in ticks of 0.1 ms. A sensor that is known to move `is_moving` and never still.
    pub(super) fn update(
        &mut self,
        time: u32,
        [turn, force]: [Vector3<f32>; 2],
        field: Option<Vector3<f32>>,
        is_moving: bool,
    ) -> Attitude {
        let elapsed = self.elapsed(time);
        let rest = self.rest(elapsed, &turn, &force).filter(|_| !is_moving);
        if let Some(rest) = rest {
            self.bias = rest.turn;
            self.error = 0.0;
            self.inertial_from_sensor = upright(&rest.force, &self.inertial_from_sensor);
        } else {
            let turn = (turn - self.bias) * elapsed;
            let drift = DRIFT * elapsed + SCALE * turn.norm();
            self.error += drift;
            self.heading_error += drift;
            let step = small_rotation(&turn);
            self.inertial_from_sensor = normalized((self.inertial_from_sensor * step).into_inner());
        }
        if let Some(field) = field {
            self.feel(&field, rest.is_some());
        }
        let force = self.inertial_from_sensor * force;
        self.aiding.see(time, &force, elapsed.min(LONGEST_GAP));
        Attitude {
            inertial_from_sensor: self.inertial_from_sensor,
            turn: Some(turn - self.bias),
            is_measured: self.error < TRUSTED
                && (!self.has_receiver || self.heading_error < TRUSTED_HEADING),
            heading_error: self.heading_error,
            north_found: core::mem::take(&mut self.north_found),
            is_levelled: true,
            is_still: rest.is_some(),
        }
    }

    /// Takes in the magnetic field (sensor axes), which bounds the error of the heading.
    fn feel(&mut self, field: &Vector3<f32>, is_at_rest: bool) {
        if !self.error.is_finite() {
            return;
        }
        let field = self.inertial_from_sensor * field;
        if is_at_rest {
            self.compass.rest(&field);
        }
        if !self.has_receiver {
            self.compass.assume_magnetic_north();
        } else if core::mem::take(&mut self.heading_told) {
            (self.compass).learn(&field, self.error, self.heading_error);
        }
        let found = (self.compass).correction(&field, self.error, self.heading_error);
        if let Some(found) = found {
            self.north_found |= !self.heading_error.is_finite();
            let (sine, cosine) = (found.turn * 0.5).sine_cosine();
            self.correct(&normalized(Quaternion::new(cosine, 0.0, 0.0, sine)));
            self.heading_error = found.error;
        }
    }

    /// Whether a sensor that sends an orientation, and so needs no levelling, lies or stands still; see [`Level::update`].
    pub(super) fn is_still(
        &mut self,
        time: u32,
        turn: &Vector3<f32>,
        force: &Vector3<f32>,
        is_moving: bool,
    ) -> bool {
        let elapsed = self.elapsed(time);
        self.rest(elapsed, turn, force).is_some() && !is_moving
    }

    /// Time since the last measurement (s); after too long a one nothing is known.
    fn elapsed(&mut self, time: u32) -> f32 {
        // Exact: longer gaps than 2^24 ticks are gaps all the same.
        let elapsed = self
            .last
            .map_or(0.0, |last| time.wrapping_sub(last) as f32 * 1e-4);
        self.last = Some(time);
        if elapsed > LONGEST_GAP {
            (self.error, self.heading_error, self.rest) = (f32::INFINITY, f32::INFINITY, None);
            self.aiding.interrupt();
        }
        elapsed
    }

    /// Corrects the attitude by a receiver's velocity (m/s, inertial axes) with this deviation, which was right `age` (s)
    /// before the last measurement.
    pub(super) fn solution(&mut self, velocity: &Vector3<f32>, deviation: f32, age: f32) {
        if !core::mem::replace(&mut self.has_receiver, true) {
            // Magnetic north is not that of the receiver.
            self.compass.forget_north();
            self.heading_error = f32::INFINITY;
        }
        let Some(now) = self.last.filter(|_| self.error.is_finite()) else {
            return;
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "saturates"
        )]
        let instant = now.wrapping_sub((age * 1e4) as u32);
        let is_known = self.heading_error < LARGEST_HEADING_ERROR;
        let attitude = (self.error.max(LEAST), is_known);
        let seen = (self.aiding).solution([instant, now], velocity, deviation, attitude);
        match seen {
            Some(Seen::Tilt(tilt, deviation)) => {
                let gain = gain(&mut self.error, deviation);
                self.correct(&small_rotation(&(tilt * gain)));
            }
            Some(Seen::Whole(turn, [tilt, heading])) => {
                let [tilt, heading] = [
                    gain(&mut self.error, tilt),
                    gain(&mut self.heading_error, heading),
                ];
                let turn = Vector3::new(turn.x * tilt, turn.y * tilt, turn.z * heading);
                self.correct(&small_rotation(&turn));
                self.heading_told = true;
            }
            Some(Seen::Heading(turn, deviation)) => {
                self.correct(&turn);
                self.heading_error = deviation.max(LEAST);
                self.north_found = true;
                self.compass.forget_north();
                self.heading_told = true;
            }
            None => {}
        }
    }

    fn correct(&mut self, turn: &UnitQuaternion<f32>) {
        self.aiding.turn(turn);
        self.inertial_from_sensor = normalized((turn * self.inertial_from_sensor).into_inner());
    }

    /// The means over the rest so far, if it has been long enough.
    fn rest(&mut self, elapsed: f32, turn: &Vector3<f32>, force: &Vector3<f32>) -> Option<Rest> {
        let is_still = |rest: &Rest| {
            (turn - rest.turn).norm() < STILL_TURN && (force - rest.force).norm() < STILL_FORCE
        };
        let is_possible =
            turn.norm() < LARGEST_BIAS && (force.norm() - STANDARD_GRAVITY).abs() < GRAVITY_ERROR;
        self.rest = match self.rest.filter(is_still) {
            _ if !is_possible => None,
            Some(rest) => {
                let count = rest.count + 1.0;
                Some(Rest {
                    turn: rest.turn + (turn - rest.turn) / count,
                    force: rest.force + (force - rest.force) / count,
                    count: count.min(MEMORY),
                    time: rest.time + elapsed,
                })
            }
            None => Some(Rest {
                turn: *turn,
                force: *force,
                count: 1.0,
                time: 0.0,
            }),
        };
        self.rest.filter(|rest| rest.time >= STILL)
    }
}

/// Number of measurements over which means are taken at most.
const MEMORY: f32 = 1000.0;

/// Error of the heading (rad) beyond which small corrections do not mend it.
const LARGEST_HEADING_ERROR: f32 = 0.3;

/// Share of a correction with this deviation (rad) that counts against an error, which becomes smaller.
fn gain(error: &mut f32, deviation: f32) -> f32 {
    let [before, noise] = [*error * *error, deviation * deviation];
    let share = before / (before + noise);
    *error *= (1.0 - share).root();
    *error = error.max(LEAST);
    share
}

/// The attitude in which `force` points up and the heading is that of `before`.
fn upright(force: &Vector3<f32>, before: &UnitQuaternion<f32>) -> UnitQuaternion<f32> {
    let up = before * force.normalize();
    // The shortest rotation of `up` to the vertical: about a horizontal axis, so it keeps the heading.
    let cosine = up.z;
    let axis = up.cross(&Vector3::z());
    let turn = if cosine > -0.999 {
        Quaternion::from_parts(1.0 + cosine, axis)
    } else {
        Quaternion::new(0.0, 1.0, 0.0, 0.0)
    };
    normalized((normalized(turn) * before).into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Attitude of a sensor after `seconds` of this angular velocity and specific force at 200 Hz from `time` on.
    fn after(
        level: &mut Level,
        time: &mut u32,
        seconds: u32,
        turn: [f32; 3],
        force: [f32; 3],
    ) -> Attitude {
        for _ in 1..seconds * 200 {
            *time = time.wrapping_add(50);
            level.update(*time, [turn.into(), force.into()], None, false);
        }
        *time = time.wrapping_add(50);
        level.update(*time, [turn.into(), force.into()], None, false)
    }

    #[test]
    fn a_still_sensor_is_level_and_its_bias_known() {
        for force in [
            [0.0, 0.0, 9.8],
            [0.0, 9.8, 0.0],
            [0.0, 0.0, -9.8],
            [5.6, -5.6, 5.6],
        ] {
            let (mut level, mut time) = (Level::default(), u32::MAX - 7_000);
            let found = after(&mut level, &mut time, 3, [0.02, -0.01, 0.03], force);
            let up = found.inertial_from_sensor * Vector3::from(force).normalize();
            assert!((up - Vector3::z()).norm() < 1e-3, "{force:?}: {up}");
            assert!(found.is_still && found.is_measured && found.turn.unwrap().norm() < 1e-5);
        }
    }

    #[test]
    fn a_turn_in_a_fall_is_integrated_without_the_bias() {
        let (mut level, mut time) = (Level::default(), 0);
        let bias = [0.02, -0.01, 0.03];
        let start = after(&mut level, &mut time, 2, bias, [0.0, 0.0, 9.8]);
        let turning = [bias[0], bias[1] + 1.0, bias[2]];
        // The force of the air points forward: it does not count.
        let end = after(&mut level, &mut time, 2, turning, [7.0, 0.0, 9.0]);
        let turned = start.inertial_from_sensor.inverse() * end.inertial_from_sensor;
        assert!(end.is_measured && !end.is_still);
        assert!(
            (turned.scaled_axis() - Vector3::y() * 2.0).norm() < 0.02,
            "{turned}"
        );
    }

    /// Turns by 20 rad about the vertical after a receiver has told north in a field 0.3 rad off; the gyroscope reads 0.5 %
    /// too much. Returns the last attitude and the angle that was turned.
    fn turned_for_long(has_magnetometer: bool) -> (Attitude, f32) {
        let (mut level, mut time) = (Level::default(), 0_u32);
        let (mut heading, mut velocity, mut last) = (0.4_f32, Vector3::zeros(), None);
        let field = Vector3::new(0.45 * 0.3_f32.cos(), 0.45 * 0.3_f32.sin(), -0.89);
        for sample in 0..30 * 100_u32 {
            time += 100;
            // At rest for 2 s, then thrown forwards for 8 s; the turn begins when nothing tells north any more.
            let along = if (200..1000).contains(&sample) {
                5.0
            } else {
                0.0
            };
            let rate = if sample > 1000 { 1.0 } else { 0.0 };
            heading += rate * 0.01;
            velocity += Vector3::x() * along * 0.01;
            let (sine, cosine) = (heading * 0.5).sine_cosine();
            let truth = UnitQuaternion::new_normalize(Quaternion::new(cosine, 0.0, 0.0, sine));
            let force = truth.inverse() * Vector3::new(along, 0.0, STANDARD_GRAVITY);
            let turn = Vector3::z() * rate * 1.005;
            let field = has_magnetometer.then(|| truth.inverse() * field);
            last = Some(level.update(time, [turn, force], field, sample > 200));
            if sample % 20 == 0 {
                level.solution(&velocity, 0.1, 0.0);
            }
        }
        (last.unwrap(), heading)
    }

    #[test]
    fn a_magnetometer_keeps_the_north_that_a_receiver_told() {
        let (without, _) = turned_for_long(false);
        assert!(!without.is_measured && without.heading_error > TRUSTED_HEADING);
        let (with, heading) = turned_for_long(true);
        let forward = with.inertial_from_sensor * Vector3::x();
        let off = Vector3::new(heading.cos(), heading.sin(), 0.0) - forward;
        assert!(off.norm() < 0.06, "{off}");
        assert!(
            with.is_measured && with.heading_error < TRUSTED_HEADING,
            "{with:?}"
        );
    }

    #[test]
    fn after_many_turns_an_attitude_is_no_measurement() {
        let (mut level, mut time) = (Level::default(), 0);
        let up = [0.0, 0.0, 9.8];
        after(&mut level, &mut time, 2, [0.0; 3], up);
        // Four seconds of a turn add 0.01 x 4 rad + 0.002 rad/s x 4 s.
        let turned = after(&mut level, &mut time, 4, [0.0, 0.0, 1.0], up);
        assert!(turned.is_measured);
        let turned = after(&mut level, &mut time, 2, [0.0, 0.0, 1.0], up);
        assert!(!turned.is_measured);
        let slow = |level: &mut Level, is_moving| {
            (0..400_u32).find(|k| {
                let found =
                    level.update(time + k * 50, [[0.0; 3].into(), up.into()], None, is_moving);
                found.is_measured
            })
        };
        assert_eq!(slow(&mut level.clone(), true), None);
        assert!(slow(&mut level, false).is_some());
    }

    #[test]
    fn what_was_never_still_or_was_interrupted_has_no_attitude() {
        let (mut level, mut time) = (Level::default(), 0);
        let up = [0.0, 0.0, 9.8];
        assert!(!after(&mut level, &mut time, 2, [0.5, 0.0, 0.0], up).is_measured);
        assert!(!after(&mut level, &mut time, 2, [0.0; 3], [0.0, 0.0, 5.0]).is_measured);
        assert!(after(&mut level, &mut time, 2, [0.0; 3], up).is_measured);
        time += 3_000;
        assert!(!after(&mut level, &mut time, 1, [0.5; 3], [0.0, 0.0, 5.0]).is_measured);
    }
}
