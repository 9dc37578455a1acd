//! The bytes that an inertial sensor at the pelvis, and a receiver on its line, would have sent during a flight.
//!
//! The sensor is an MTi that sends orientation, rate of turn, acceleration and air pressure with each frame; the
//! receiver sends UBX `NAV-PVT`. Acceleration and the receiver's velocity follow from the positions by differences, so
//! they must be those of a simulator; attitude and rate of turn are the recorded ones, with their noise.

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::frame::{Inertial, Vector};
use bodyflight_core::ubx::NavPvt;
use bodyflight_core::xbus::{CoordinateSystem, DataId, MessageId, NumberFormat, PacketWriter};
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

/// Ticks of the sensor's clock in a second.
const TICKS: f64 = 10_000.0;
/// Longest packet (bytes).
const LONGEST: usize = 128;

/// A sensor and a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorBytes {
    /// Seed of the noise.
    pub seed: u64,
    /// Standard deviation of the specific force, white and constant, each axis (m/s2); none without accelerometer.
    pub specific_force: Option<[f64; 2]>,
    /// Standard deviation of the air pressure (Pa).
    pub pressure: f64,
    /// Solutions of the receiver in a second; 0 for none.
    pub receiver_rate: f64,
    /// Time from the instant of a solution to its arrival (s).
    pub latency: f64,
    /// Standard deviations of the receiver's velocity, horizontal and vertical (m/s).
    pub velocity: [f64; 2],
    /// Accuracy that the receiver states (m/s).
    pub stated: f64,
    /// For a sensor that sends no orientation: how long it lies still before the flight, without a receiver (s), and
    /// the standard deviation of its gyroscope's bias (rad/s) and scale.
    pub raw: Option<Raw>,
}

/// A sensor of rates and forces alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Raw {
    /// Time at rest before the flight (s), in the attitude in which that begins.
    pub rest: f64,
    /// Standard deviation of the gyroscope's bias, each axis (rad/s).
    pub bias: f64,
    /// Standard deviation of the error of its scale, each axis.
    pub scale: f64,
    /// Its magnetometer, if it has one.
    pub magnetometer: Option<Magnetometer>,
}

/// A magnetometer in a field of strength 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Magnetometer {
    /// Angle of the field below the horizon (rad).
    pub dip: f64,
    /// Angle of its horizontal part from north towards west (rad).
    pub declination: f64,
    /// Standard deviation of what the sensor and its surroundings add, constant in sensor axes and white, each axis.
    pub error: [f64; 2],
}

impl Magnetometer {
    /// The field in inertial axes.
    fn field(&self) -> Vector<f64, Inertial> {
        let (down, along) = self.dip.sin_cos();
        let (west, north) = self.declination.sin_cos();
        Vector::new(along * north, along * west, -down)
    }
}

impl SensorBytes {
    /// An MTi-3 and a receiver of the M8 generation by their data sheets, in the open sky.
    pub const TYPICAL: Self = Self {
        seed: 0,
        specific_force: Some([0.02, 0.05]),
        pressure: 3.0,
        receiver_rate: 5.0,
        latency: 0.1,
        velocity: [0.1, 0.2],
        stated: 0.25,
        raw: None,
    };

    /// The bytes sent with each frame, and after which time they are complete (s).
    pub fn of(&self, frames: &[FlightFrame]) -> Vec<(f64, Vec<u8>)> {
        let mut noise = Noise(ChaCha8Rng::seed_from_u64(self.seed));
        let [white, constant] = self.specific_force.unwrap_or_default();
        let bias = noise.vector(constant);
        let raw = self.raw.map(|raw| RawErrors {
            bias: noise.vector(raw.bias),
            scale: noise.vector(raw.scale).add_scalar(1.0),
            magnetometer: raw.magnetometer.map(|magnetometer| {
                let [constant, white] = magnetometer.error;
                (magnetometer.field(), noise.vector(constant), white)
            }),
        });
        let mut answered = 0.0;
        let mut sent = self.at_rest(frames, bias, raw.as_ref(), &mut noise);
        let (lead, rest) = (sent.len(), self.raw.map_or(0.0, |raw| raw.rest));
        for (index, frame) in frames.iter().enumerate() {
            let [before, after] = [index.saturating_sub(1), index + 1];
            let [Some(before), Some(after)] = [before, after].map(|at| frames.get(at)) else {
                continue;
            };
            let fall = free_acceleration([before, frame, after]);
            let body_from_inertial = frame.pelvis.inertial_from_body.inverse();
            let force = body_from_inertial * (fall + Vector::new(0.0, 0.0, STANDARD_GRAVITY));
            let force = Vector3::from(force.to_array()) + bias + noise.vector(white);
            let force = self.specific_force.map(|_| force);
            let pressure = pressure_at(frame.pelvis.position.up()) + self.pressure * noise.normal();
            let at = (lead + index, rest + frame.time);
            let magnetic = raw.as_ref().and_then(|raw| raw.magnetic(frame, &mut noise));
            let mut bytes = packet(at, frame, raw.as_ref(), [force, magnetic], pressure);
            // The solution that arrives now, and its instant.
            let instant = frame.time - self.latency;
            if self.receiver_rate > 0.0 && instant >= answered {
                answered += 1.0 / self.receiver_rate;
                let at = frames.partition_point(|frame| frame.time < instant);
                let velocity = velocity_at(frames, at) + noise.velocity(self.velocity);
                bytes.extend(solution(instant, &velocity, self.stated).encode());
            }
            sent.push((frame.time, bytes));
        }
        sent
    }

    /// The bytes before the flight, at times below zero.
    fn at_rest(
        &self,
        frames: &[FlightFrame],
        bias: Vector3<f64>,
        errors: Option<&RawErrors>,
        noise: &mut Noise,
    ) -> Vec<(f64, Vec<u8>)> {
        let (Some(raw), Some(errors), [first, second, ..]) = (self.raw, errors, frames) else {
            return Vec::new();
        };
        let interval = second.time - first.time;
        let mut still = *first;
        still.pelvis.angular_velocity = Some(Vector::zero());
        let body_from_inertial = first.pelvis.inertial_from_body.inverse();
        let up = body_from_inertial * Vector::<f64, Inertial>::new(0.0, 0.0, STANDARD_GRAVITY);
        let [white, _] = self.specific_force.unwrap_or_default();
        let mut sent = Vec::new();
        while (sent.len() as f64) * interval < raw.rest {
            let time = sent.len() as f64 * interval;
            let force = Vector3::from(up.to_array()) + bias + noise.vector(white);
            let force = self.specific_force.map(|_| force);
            let pressure = pressure_at(first.pelvis.position.up());
            let vectors = [force, errors.magnetic(&still, noise)];
            let bytes = packet((sent.len(), time), &still, Some(errors), vectors, pressure);
            sent.push((time - raw.rest, bytes));
        }
        sent
    }
}

/// Errors of a sensor of rates and forces.
struct RawErrors {
    /// Bias of the gyroscope (rad/s).
    bias: Vector3<f64>,
    /// Factor of each of its axes.
    scale: Vector3<f64>,
    /// The earth's field, what is added to it in sensor axes, and the deviation of the noise.
    magnetometer: Option<(Vector<f64, Inertial>, Vector3<f64>, f64)>,
}

impl RawErrors {
    /// What a magnetometer reads (sensor axes).
    fn magnetic(&self, frame: &FlightFrame, noise: &mut Noise) -> Option<Vector3<f64>> {
        let (field, added, white) = self.magnetometer?;
        let field = frame.pelvis.inertial_from_body.inverse() * field;
        Some(Vector3::from(field.to_array()) + added + noise.vector(white))
    }
}

struct Noise(ChaCha8Rng);

impl Noise {
    fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    fn vector(&mut self, size: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| size * self.normal())
    }

    fn velocity(&mut self, [horizontal, vertical]: [f64; 2]) -> Vector<f64, Inertial> {
        let [north, west, up] = [horizontal, horizontal, vertical].map(|size| size * self.normal());
        Vector::new(north, west, up)
    }
}

/// Acceleration at the middle one of three frames (m/s2).
fn free_acceleration([before, now, after]: [&FlightFrame; 3]) -> Vector<f64, Inertial> {
    let [first, last] = [now.time - before.time, after.time - now.time];
    if first <= 0.0 || last <= 0.0 {
        // The first frame has none before it: as in the next ones, a steady fall.
        return Vector::zero();
    }
    let arriving = (now.pelvis.position - before.pelvis.position) * (1.0 / first);
    let leaving = (after.pelvis.position - now.pelvis.position) * (1.0 / last);
    (leaving - arriving) * (2.0 / (first + last))
}

/// Velocity at a frame, from its neighbours (m/s).
fn velocity_at(frames: &[FlightFrame], at: usize) -> Vector<f64, Inertial> {
    let last = frames.len().saturating_sub(1);
    let ends = [at.saturating_sub(1).min(last), (at + 1).min(last)].map(|at| frames.get(at));
    let [Some(before), Some(after)] = ends else {
        return Vector::zero();
    };
    let elapsed = (after.time - before.time).max(f64::EPSILON);
    (after.pelvis.position - before.pelvis.position) * (1.0 / elapsed)
}

/// Pressure of the standard atmosphere (Pa) at a height (m).
fn pressure_at(height: f64) -> f64 {
    101_325.0 * (1.0 - 2.255_77e-5 * height).max(0.0).powf(5.255_88)
}

#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the sensor's formats; counters wrap"
)]
fn packet(
    (index, time): (usize, f64),
    frame: &FlightFrame,
    raw: Option<&RawErrors>,
    [force, magnetic]: [Option<Vector3<f64>>; 2],
    pressure: f64,
) -> Vec<u8> {
    let pelvis = &frame.pelvis;
    let attitude_wxyz = pelvis.inertial_from_body.wxyz().map(|part| part as f32);
    let turn = pelvis.angular_velocity.map(|spin| {
        let spin = pelvis.inertial_from_body.inverse() * spin;
        let spin = Vector3::from(spin.to_array());
        raw.map_or(spin, |raw| spin.component_mul(&raw.scale) + raw.bias)
    });
    let single = |vector: Vector3<f64>| [vector.x, vector.y, vector.z].map(|part| part as f32);
    let mut bytes = [0; LONGEST];
    let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
    let counter = (index as u16).to_be_bytes();
    let ticks = ((time * TICKS).round() as u32).to_be_bytes();
    let pressure = (pressure.round() as u32).to_be_bytes();
    let attitude = DataId::QUATERNION.with(CoordinateSystem::NorthWestUp, NumberFormat::Float32);
    // The buffer holds all items.
    let _ = writer.item(DataId::PACKET_COUNTER, &counter);
    let _ = writer.item(DataId::SAMPLE_TIME_FINE, &ticks);
    if raw.is_none() {
        let _ = writer.reals(attitude, &attitude_wxyz);
    }
    let vectors = [
        (DataId::RATE_OF_TURN, turn),
        (DataId::ACCELERATION, force),
        (DataId::MAGNETIC_FIELD, magnetic),
    ];
    for (id, vector) in vectors {
        if let Some(vector) = vector {
            let _ = writer.reals(id, &single(vector));
        }
    }
    let _ = writer.item(DataId::BARO_PRESSURE, &pressure);
    let length = writer.finish().unwrap_or(0);
    bytes.get(..length).unwrap_or_default().to_vec()
}

/// A valid three-dimensional fix.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "the receiver's formats"
)]
pub(crate) fn solution(time: f64, velocity: &Vector<f64, Inertial>, stated: f64) -> NavPvt {
    let velocity_mps = Vector3::from(velocity.cast::<f32>().to_array());
    NavPvt {
        time_of_week_ms: (time * 1e3).max(0.0) as u32,
        fix: 3,
        is_valid: true,
        height_m: 0.0,
        velocity_mps,
        ground_speed_mps: velocity_mps.xy().norm(),
        speed_accuracy_mps: stated as f32,
        height_msl_m: 0.0,
        vertical_accuracy_m: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::Posture;
    use bodyflight_core::frame::Rotation;
    use bodyflight_core::ubx;
    use bodyflight_core::xbus::{Decoder, Item};
    use bodyflight_mvnx::recording::PelvisMotion;
    use nalgebra::UnitQuaternion;

    /// A body that falls freely from rest, turned by a quarter about the vertical, at 100 Hz.
    fn falling(index: u64) -> FlightFrame {
        let time = index as f64 / 100.0;
        let quarter = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), 0.5);
        FlightFrame {
            index,
            time,
            posture: Posture::h_pose(),
            pelvis: PelvisMotion {
                inertial_from_body: Rotation::from_quaternion(quarter),
                position: Vector::new(
                    20.0 * time,
                    0.0,
                    1000.0 - 0.5 * STANDARD_GRAVITY * time * time,
                ),
                velocity: None,
                angular_velocity: Some(Vector::new(0.0, 0.0, 0.5)),
            },
            centre_of_mass: None,
            bridged: false,
        }
    }

    #[test]
    fn decoders_read_back_what_was_flown() {
        let frames: Vec<_> = (0..300).map(falling).collect();
        let exact = SensorBytes {
            specific_force: Some([0.0; 2]),
            velocity: [0.0; 2],
            pressure: 0.0,
            ..SensorBytes::TYPICAL
        };
        let bytes: Vec<u8> = exact.of(&frames).into_iter().flat_map(|(_, b)| b).collect();
        let mut receiver = ubx::Decoder::new();
        let found: Vec<_> = bytes.iter().filter_map(|&b| receiver.push(b)).collect();
        assert_eq!(found.len(), 15);
        for solution in &found {
            let time = f64::from(solution.time_of_week_ms) * 1e-3;
            let velocity = solution.velocity().unwrap();
            assert!((velocity.x - 20.0).abs() < 2e-3, "{velocity}");
            assert!((f64::from(velocity.z) + STANDARD_GRAVITY * time).abs() < 0.1);
        }
        let (mut decoder, mut input) = (Decoder::<512>::new(), &bytes[..]);
        let (mut packets, mut weightless) = (0, 0);
        while let Some(packet) = decoder.next(&mut input) {
            packets += 1;
            for item in packet.items().filter_map(|item| item.decode().ok()) {
                match item {
                    Item::Acceleration(force) => {
                        let force = Vector3::from(force.to_f64());
                        weightless += usize::from(force.norm() < 1e-3);
                    }
                    Item::RateOfTurn(turn) => assert!((turn.to_f64()[2] - 0.5).abs() < 1e-6),
                    Item::BaroPressure(pascals) => assert!((89_800..90_400).contains(&pascals)),
                    _ => {}
                }
            }
        }
        // Of the first sample nothing is known but its attitude; the last has none after it.
        assert_eq!((packets, weightless), (299, 298));
    }
}
