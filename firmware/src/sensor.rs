//! The sensor on the unit's second port: converts its bytes to samples.
//!
//! An Xsens MTi at the pelvis provides attitude, angular velocity, specific force and, where it has them, air pressure
//! and the velocity of its receiver; a BNO08x in its UART-RVC mode attitude and specific force. A sensor that never sends
//! an orientation is levelled at rest, and then its angular velocity is integrated; a receiver corrects it and finds its
//! heading, and a magnetometer keeps it. The posture stays as the host set it;
//! without one it is assumed. An MTi must be configured beforehand to send MTData2 with packet counter, sample time,
//! acceleration and rate of turn, and orientation if it has it; see `docs/unit.md`. `NAV-PVT` solutions (UBX) of a u-blox
//! receiver on the same port provide velocity for the next sample. On a line with several sensors the first that sends an
//! orientation counts. Sensors on the limbs ([`crate::limbs`]) give the posture, and that on the pelvis what a sensor
//! without an orientation does.

mod aiding;
mod compass;
pub mod icm42688;
mod level;
mod reading;
mod receiver;
pub(crate) mod rvc;
pub mod rvc_suit;

use bodyflight_core::chain;
use bodyflight_core::estimator::motion::sensors::VERTICAL_RATIO;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{
    Header, Motion, Readings, Sample, SegmentErrors, SensorKind, Sensors, Validity,
};
use bodyflight_core::ubx;
use bodyflight_core::xbus::{Decoder, MessageId, SampleClock};
use bodyflight_core::{Body, Lanes, Posture};
use nalgebra::{UnitQuaternion, Vector3};

use crate::limbs::{Limbs, PelvisReading};
pub(crate) use aiding::STANDARD_GRAVITY;
use level::{Attitude, Level};
use reading::Reading;
use receiver::{Receiver, Solution};

/// Rate of the line of a sensor of this kind (baud): an MTi as it is set up for the unit, the others as they always are.
pub const fn line_rate(kind: SensorKind) -> u32 {
    match kind {
        SensorKind::Xbus => 460_800,
        SensorKind::Bno08xRvc => 115_200,
        SensorKind::Chain => chain::BAUD,
    }
}

/// Longest packet accepted from a sensor (bytes).
const LONGEST: usize = 512;

/// Time that is assumed to pass while a sensor restarts (us). The true one is unknown; this is longer than the model
/// bridges, so that the motion is taken anew from the next sample.
const RESTART: u64 = 1_000_000;

/// Standard deviation of a velocity in unknown axes (m/s).
const NO_NORTH: f32 = 60.0;

/// Speed of a receiver on somebody who moves (m/s), and the time for which this holds (us).
const MOVING_SPEED: f32 = 3.0;
const MOVING: u64 = 3_000_000;

/// Age (us) beyond which a pressure is not attached to a sample.
const OLDEST_PRESSURE: u64 = 500_000;

/// A sample with what else was measured at its instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensed {
    /// Number and time; the caller sets the session.
    pub header: Header,
    /// Posture and motion.
    pub sample: Sample,
    /// The other measurements.
    pub sensors: Sensors,
    /// Errors of the posture from this sample on, if sensors on the limbs measure it and they have changed.
    pub errors: Option<SegmentErrors>,
}

/// Converts bytes of the sensor to samples.
#[derive(Debug)]
pub struct Sensor {
    kind: SensorKind,
    decoder: Decoder<LONGEST>,
    rvc: rvc::Decoder,
    limbs: Limbs,
    solution_decoder: ubx::Decoder,
    receiver: Receiver,
    clock: SampleClock,
    restarts: u32,
    body_from_sensor: UnitQuaternion<f32>,
    /// Age of a UBX solution on arrival (s).
    latency: f32,
    /// As the host set it; without one the H-pose is assumed.
    posture: Option<Posture<f32>>,
    solution: Option<Solution>,
    solutions: u32,
    /// Latest pressure (Pa) and its time of arrival (us).
    pressure: Option<(u32, u64)>,
    /// Address of the sensor in use.
    address: Option<u8>,
    /// Address of the first sensor that sent rates and forces but no orientation.
    raw_address: Option<u8>,
    /// Attitude of a sensor that sends none, and time (us) at which a receiver said last that it moves.
    level: Level,
    moved: Option<u64>,
    /// The sensor's counter and our sequence number of the last packet.
    last: Option<(u16, u32)>,
}

impl Default for Sensor {
    fn default() -> Self {
        Self::new()
    }
}

impl Sensor {
    /// Creates a sensor aligned with the body axes, on a body in the H-pose.
    pub fn new() -> Self {
        Self {
            kind: SensorKind::Xbus,
            decoder: Decoder::new().only(MessageId::MT_DATA2),
            rvc: rvc::Decoder::new(),
            limbs: Limbs::new(),
            solution_decoder: ubx::Decoder::new(),
            receiver: Receiver::default(),
            clock: SampleClock::new(),
            restarts: 0,
            body_from_sensor: UnitQuaternion::identity(),
            latency: 0.1,
            posture: None,
            solution: None,
            solutions: 0,
            pressure: None,
            address: None,
            raw_address: None,
            level: Level::default(),
            moved: None,
            last: None,
        }
    }

    /// Sets the mounting: the rotation from sensor axes to body axes.
    pub fn mount(&mut self, body_from_sensor: UnitQuaternion<f32>) {
        self.body_from_sensor = body_from_sensor;
    }

    /// Sets the protocol of the sensor, and the age of a UBX solution on arrival (s). Returns the rate of the line (baud)
    /// if it changes.
    pub fn connect(&mut self, kind: SensorKind, latency: f32) -> Option<u32> {
        let [before, rate] = [self.kind, kind].map(line_rate);
        (self.kind, self.latency) = (kind, latency);
        (before != rate).then_some(rate)
    }

    /// The sensors on the limbs.
    pub fn limbs(&self) -> &Limbs {
        &self.limbs
    }

    /// The sensors on the limbs, to calibrate them.
    pub fn limbs_mut(&mut self) -> &mut Limbs {
        &mut self.limbs
    }

    /// Adopts the posture of a sample if it has one.
    pub fn set_posture(&mut self, sample: &Sample) {
        if sample.valid.contains(Validity::POSTURE) {
            self.posture = Some(sample.posture());
        }
    }

    /// Restarts the sequence numbers and forgets pending solutions.
    pub fn restart(&mut self) {
        self.last = None;
        self.solution = None;
        self.receiver = Receiver::default();
        self.pressure = None;
        self.address = None;
        self.raw_address = None;
        self.level = Level::default();
        self.moved = None;
    }

    /// Number of restarts of the sensor, and number of a receiver's solutions; both wrap.
    pub fn counts(&self) -> [u32; 2] {
        [self.restarts, self.solutions]
    }

    /// Searches bytes for the solutions of a receiver, arriving at `now` (us).
    pub fn receive_solutions(&mut self, bytes: &[u8], now: u64) {
        for &byte in bytes {
            let Some(solution) = self.solution_decoder.push(byte) else {
                continue;
            };
            self.solutions = self.solutions.wrapping_add(1);
            if let Some(velocity) = solution.velocity() {
                #[expect(clippy::cast_possible_truncation, reason = "wraps")]
                let now_ms = (now / 1000) as u32;
                let measures = self.hear(&velocity, now);
                let late = self.receiver.lateness(solution.time_of_week_ms, now_ms);
                if measures {
                    self.answer(Solution {
                        velocity,
                        speed: solution.ground_speed_mps,
                        deviation: solution.speed_accuracy_mps,
                        arrived: now,
                        age: self.latency + late,
                    });
                }
            }
        }
    }

    /// Returns the next sample, and advances `input` past the bytes used; `None` if more bytes are needed. `now` (us)
    /// replaces a missing sensor time. `body` is needed by sensors on the limbs.
    pub fn next(
        &mut self,
        input: &mut &[u8],
        now: u64,
        body: Option<&Body<f32>>,
    ) -> Option<Sensed> {
        loop {
            let reading = match self.kind {
                SensorKind::Xbus => {
                    let packet = self.decoder.next(input)?;
                    if self.address.is_some_and(|own| own != packet.bus_id) {
                        continue;
                    }
                    let reading = Reading::of(&packet);
                    if reading.inertial_from_sensor.is_some() {
                        self.address = Some(packet.bus_id);
                    } else if reading.is_raw()
                        && *self.raw_address.get_or_insert(packet.bus_id) != packet.bus_id
                    {
                        continue;
                    }
                    reading
                }
                SensorKind::Bno08xRvc => self.rvc.next(input)?,
                SensorKind::Chain => {
                    let reading = self.limbs.next(input, body)?;
                    self.posture = self.limbs.posture();
                    reading.into()
                }
            };
            self.hold(&reading, now);
            if let Some(attitude) = self.attitude(&reading, now) {
                return Some(self.sample(&reading, &attitude, now));
            }
            self.pass(&reading);
        }
    }

    /// The attitude at a packet: as the sensor sends it or, if it never does, from angular velocity and specific force.
    fn attitude(&mut self, reading: &Reading, now: u64) -> Option<Attitude> {
        // Differences count only, so it may wrap.
        #[expect(clippy::cast_possible_truncation, reason = "wraps")]
        let time = reading.fine_time.unwrap_or((now / 100) as u32);
        let is_moving = self
            .moved
            .is_some_and(|moved| now.saturating_sub(moved) < MOVING);
        let raw = reading.angular_velocity.zip(reading.specific_force);
        if let Some(inertial_from_sensor) = reading.inertial_from_sensor {
            let is_still = raw
                .is_some_and(|(turn, force)| (self.level).is_still(time, &turn, &force, is_moving));
            return Some(Attitude {
                inertial_from_sensor,
                turn: reading.angular_velocity,
                is_measured: true,
                heading_error: 0.0,
                north_found: false,
                is_levelled: false,
                is_still,
            });
        }
        let (turn, force) = raw.filter(|_| self.address.is_none())?;
        let field = reading.magnetic_field;
        Some((self.level).update(time, [turn, force], field, is_moving))
    }

    /// Keeps a packet's solution and pressure for the next sample: they may come in packets of their own.
    fn hold(&mut self, reading: &Reading, now: u64) {
        if let Some(pressure) = reading.pressure {
            self.pressure = Some((pressure, now));
        }
        let Some((velocity, speed, deviation)) = reading.solution else {
            return;
        };
        self.solutions = self.solutions.wrapping_add(1);
        if self.hear(&velocity, now) {
            // The sensor gives such a packet the time of the solution, so its age is known; the clock does not advance.
            let age = reading.fine_time.and_then(|fine| self.clock.behind(fine));
            self.answer(Solution {
                velocity,
                speed,
                deviation,
                arrived: now,
                age: age.unwrap_or(self.latency),
            });
        }
    }

    /// Takes a receiver's velocity (m/s), and whether it is that of somebody who moves. Returns whether the receiver still
    /// measures.
    fn hear(&mut self, velocity: &Vector3<f32>, now: u64) -> bool {
        let is_moving = velocity.norm() > MOVING_SPEED;
        let measures = self.receiver.measures(velocity, is_moving);
        if is_moving && measures {
            self.moved = Some(now);
        }
        measures
    }

    /// Uses a solution.
    fn answer(&mut self, solution: Solution) {
        self.level
            .solution(&solution.velocity, solution.deviation, solution.age);
        self.solution = Some(solution);
    }

    /// Counts a packet without an orientation, which has a number of its own: it is no missing sample.
    fn pass(&mut self, reading: &Reading) {
        if let (Some(counter), Some((last, _))) = (reading.counter, &mut self.last)
            && counter == last.wrapping_add(1)
        {
            *last = counter;
        }
    }

    /// Number and time of a packet's sample.
    fn header(&mut self, reading: &Reading, now: u64) -> Header {
        let before = self.clock.restarts();
        let time = reading.fine_time.map(|fine| self.clock.time(fine));
        let restarted = self.clock.restarts() != before;
        self.restarts = self.restarts.wrapping_add(u32::from(restarted));
        let sequence = match (reading.counter, self.last) {
            (_, None) => 0,
            // A restarted sensor counts from zero again: nothing is missing.
            (Some(counter), Some((last, number))) if !restarted => {
                let step = counter.wrapping_sub(last);
                number.wrapping_add(u32::from(step))
            }
            (_, Some((_, number))) => number.wrapping_add(1),
        };
        self.last = Some((reading.counter.unwrap_or_default(), sequence));
        let elapsed = RESTART * u64::from(self.clock.restarts());
        Header {
            session: 0,
            sequence,
            time: time.map_or(now, |time| time + elapsed),
        }
    }

    fn sample(&mut self, reading: &Reading, attitude: &Attitude, now: u64) -> Sensed {
        let header = self.header(reading, now);
        let solution = self.solution.take();
        let body_from_sensor = match self.kind {
            // Calibrated: in body axes already.
            SensorKind::Chain => UnitQuaternion::identity(),
            SensorKind::Xbus | SensorKind::Bno08xRvc => self.body_from_sensor,
        };
        let inertial_from_body = attitude.inertial_from_sensor * body_from_sensor.inverse();
        let body_axes = |vector| Vector::from_components(body_from_sensor * vector);
        let known = solution.filter(|_| attitude.heading_error < level::TRUSTED_HEADING);
        let pressure = self.pressure.take();
        let pressure = pressure.filter(|(_, at)| now.saturating_sub(*at) < OLDEST_PRESSURE);
        let mut readings = Readings {
            specific_force: reading.specific_force.map(body_axes),
            pressure: pressure.map(|(pressure, _)| pressure),
            north_found: attitude.north_found,
            is_levelled: attitude.is_levelled,
            is_still: attitude.is_still,
            ..Readings::default()
        };
        if let Some(solution) = solution {
            let waited = u32::try_from(now.saturating_sub(solution.arrived)).unwrap_or(u32::MAX);
            readings.receiver_velocity = Some(Vector::from_components(solution.velocity));
            // Against an attitude whose north may be another, a velocity is worth less the faster it is.
            let turned = (attitude.heading_error * solution.velocity.xy().norm()).min(NO_NORTH);
            let horizontal = (solution.deviation * solution.deviation + turned * turned).root();
            readings.receiver_deviation = [horizontal, VERTICAL_RATIO * solution.deviation];
            readings.receiver_age = solution.age + waited as f32 * 1e-6;
        }
        let sensors = Sensors::new(&readings);
        // A velocity beyond all bounds has no speed either.
        let known = known.filter(|_| sensors.receiver().is_some());
        let velocity = known.map(|solution| solution.velocity);
        let motion = Motion {
            angular_velocity: attitude.turn.map(body_axes),
            velocity: reading.velocity.or(velocity).map(Vector::from_components),
            horizontal_speed: known.map(|solution| solution.speed),
        };
        let inertial_from_body = Rotation::from_quaternion(inertial_from_body);
        let posture = self.posture.unwrap_or_else(Posture::h_pose);
        let mut sample = Sample::new(&posture, &inertial_from_body, &motion);
        sample.valid.set(Validity::ATTITUDE, attitude.is_measured);
        sample.valid.set(Validity::POSTURE, self.posture.is_some());
        Sensed {
            header,
            sample,
            sensors,
            errors: self.limbs.new_errors(),
        }
    }
}

impl From<PelvisReading> for Reading {
    fn from(reading: PelvisReading) -> Self {
        Self {
            counter: Some(reading.cycle),
            fine_time: Some(reading.fine_time),
            angular_velocity: Some(reading.angular_velocity),
            specific_force: Some(reading.specific_force),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests;
