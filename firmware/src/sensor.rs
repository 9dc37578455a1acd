//! The inertial sensor on the unit's second port: converts Xbus packets to samples.
//!
//! An MTi at the pelvis provides attitude, angular velocity and, with a receiver, velocity; the posture stays as the
//! host set it. The sensor must be configured beforehand to send MTData2 with packet counter, sample time, orientation
//! and rate of turn; see `docs/unit.md`. `NAV-PVT` solutions (UBX) of a u-blox receiver on the same port provide
//! velocity and speed for the next sample that has none of its own.

use bodyflight_core::Posture;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{Header, Motion, Sample, Validity};
use bodyflight_core::math::normalized;
use bodyflight_core::ubx;
use bodyflight_core::xbus::{Decoder, Item, Packet, SampleClock};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// Longest packet accepted from a sensor (bytes).
const LONGEST: usize = 512;

/// Converts bytes of the sensor to samples.
#[derive(Debug)]
pub struct Sensor {
    decoder: Decoder<LONGEST>,
    receiver: ubx::Decoder,
    clock: SampleClock,
    body_from_sensor: UnitQuaternion<f32>,
    posture: Posture<f32>,
    /// Latest speed from satellites that has not been attached to a sample (m/s).
    speed: Option<f32>,
    /// Latest velocity that has not been attached to a sample, in inertial axes (m/s).
    velocity: Option<Vector3<f32>>,
    /// The sensor's counter and our sequence number of the last packet.
    last: Option<(u16, u32)>,
}

/// The content of a packet.
#[derive(Debug, Clone, Copy, Default)]
struct Reading {
    counter: Option<u16>,
    fine_time: Option<u32>,
    inertial_from_sensor: Option<UnitQuaternion<f32>>,
    /// In sensor axes (rad/s).
    angular_velocity: Option<Vector3<f32>>,
    /// In inertial axes (m/s).
    velocity: Option<Vector3<f32>>,
    speed: Option<f32>,
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
            decoder: Decoder::new(),
            receiver: ubx::Decoder::new(),
            clock: SampleClock::new(),
            body_from_sensor: UnitQuaternion::identity(),
            posture: Posture::h_pose(),
            speed: None,
            velocity: None,
            last: None,
        }
    }

    /// Sets the mounting: the rotation from sensor axes to body axes.
    pub fn mount(&mut self, body_from_sensor: UnitQuaternion<f32>) {
        self.body_from_sensor = body_from_sensor;
    }

    /// Adopts the posture of a sample if it has one.
    pub fn set_posture(&mut self, sample: &Sample) {
        if sample.valid.contains(Validity::POSTURE) {
            self.posture = sample.posture();
        }
    }

    /// Restarts the sequence numbers and forgets pending solutions.
    pub fn restart(&mut self) {
        self.last = None;
        self.speed = None;
        self.velocity = None;
    }

    /// Searches bytes for the solutions of a receiver.
    pub fn receive_solutions(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(solution) = self.receiver.push(byte) else {
                continue;
            };
            if let Some(velocity) = solution.velocity() {
                self.velocity = Some(velocity);
                self.speed = Some(solution.ground_speed_mps);
            }
        }
    }

    /// Returns the next sample, and advances `input` past the bytes used; `None` if more bytes are needed. `now` (us)
    /// replaces a missing sensor time.
    pub fn next(&mut self, input: &mut &[u8], now: u64) -> Option<(Header, Sample)> {
        loop {
            let reading = Reading::of(&self.decoder.next(input)?);
            self.speed = reading.speed.or(self.speed);
            if let Some(inertial_from_sensor) = reading.inertial_from_sensor {
                return Some(self.sample(&reading, &inertial_from_sensor, now));
            }
        }
    }

    fn sample(
        &mut self,
        reading: &Reading,
        inertial_from_sensor: &UnitQuaternion<f32>,
        now: u64,
    ) -> (Header, Sample) {
        let sequence = match (reading.counter, self.last) {
            (_, None) => 0,
            (Some(counter), Some((last, number))) => {
                number.wrapping_add(u32::from(counter.wrapping_sub(last)))
            }
            (None, Some((_, number))) => number.wrapping_add(1),
        };
        self.last = Some((reading.counter.unwrap_or_default(), sequence));
        let header = Header {
            session: 0,
            sequence,
            time: reading.fine_time.map_or(now, |fine| self.clock.time(fine)),
        };
        let inertial_from_body = inertial_from_sensor * self.body_from_sensor.inverse();
        let motion = Motion {
            angular_velocity: reading
                .angular_velocity
                .map(|turn| Vector::from_components(self.body_from_sensor * turn)),
            velocity: reading
                .velocity
                .or(self.velocity.take())
                .map(Vector::from_components),
            horizontal_speed: self.speed.take(),
        };
        let attitude = Rotation::from_quaternion(inertial_from_body);
        (header, Sample::new(&self.posture, &attitude, &motion))
    }
}

impl Reading {
    fn of(packet: &Packet<'_>) -> Self {
        let mut reading = Self::default();
        for item in packet.items() {
            match item.decode() {
                Ok(Item::PacketCounter(counter)) => reading.counter = Some(counter),
                Ok(Item::SampleTimeFine(time)) => reading.fine_time = Some(time),
                Ok(Item::Quaternion(system, values)) => {
                    let [w, x, y, z] = values.to_f32();
                    let sent = Quaternion::new(w, x, y, z);
                    // Sensors send a norm of one to a few digits; anything else is not a rotation.
                    let is_rotation = (sent.norm_squared() - 1.0).abs() < 0.02;
                    reading.inertial_from_sensor =
                        is_rotation.then(|| system.inertial_from_earth() * normalized(sent));
                }
                Ok(Item::RateOfTurn(values)) => {
                    reading.angular_velocity = Some(values.to_f32().into());
                }
                Ok(Item::VelocityXyz(system, values)) => {
                    let velocity = Vector3::from(values.to_f32());
                    reading.velocity = Some(system.inertial_from_earth() * velocity);
                }
                Ok(Item::GnssPvt(solution)) => reading.speed = solution.horizontal_speed(),
                _ => {}
            }
        }
        reading
    }
}

#[cfg(test)]
mod tests;
