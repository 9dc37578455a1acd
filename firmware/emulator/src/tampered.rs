//! The packets of a sensor and of a receiver taken apart, so that a test can falsify what they say, and the unit's
//! application in virtual time with the bytes that are made of them again.

use std::cell::{Cell, RefCell};
use std::ops::Range;

use bodyflight_core::estimator::motion::state::{ATTITUDE, MUSCLE, STATES, VELOCITY};
use bodyflight_core::link::{
    Estimate, Header, Hello, MAX_FRAME_LENGTH, Message, SCHEMA_HASH, Sample, Setup,
};
use bodyflight_core::ubx::{self, NavPvt};
use bodyflight_core::xbus::{
    CoordinateSystem, DataId, Decoder, Item, MessageId, NumberFormat, PacketWriter,
};
use bodyflight_firmware::{Board, Identity, Unit};
use nalgebra::{UnitQuaternion, Vector3};

use crate::sensed::{Sensed, is_consistent};

/// Longest packet (bytes).
const LONGEST: usize = 128;

/// What a sensor and a receiver send with one frame of the flight.
#[derive(Debug, Clone, Default)]
pub struct Sent {
    /// Time of the frame in the flight (s).
    pub time: f64,
    /// Time at which the bytes arrive (s).
    pub arrives: f64,
    /// The sensor's counter and clock (ticks of 0.1 ms).
    pub counter: u16,
    /// See `counter`.
    pub ticks: u32,
    /// Attitude, w, x, y, z.
    pub attitude_wxyz: Option<[f32; 4]>,
    /// Rate of turn (rad/s).
    pub turn: Option<[f32; 3]>,
    /// Specific force (m/s2).
    pub force: Option<[f32; 3]>,
    /// Air pressure (Pa).
    pub pressure: Option<u32>,
    /// A solution of the receiver.
    pub solution: Option<NavPvt>,
    /// Bytes that are neither.
    pub noise: Vec<u8>,
    /// Whether the line is dead.
    pub is_silent: bool,
    /// What a host sends before it.
    pub posture: Option<Sample>,
}

impl Sent {
    /// Takes the bytes of a flight apart.
    pub fn of(bytes: &[(f64, Vec<u8>)]) -> Vec<Self> {
        let mut receiver = ubx::Decoder::new();
        let mut decoder = Decoder::<LONGEST>::new();
        let all = bytes.iter().map(|(time, bytes)| {
            let mut sent = Self {
                time: *time,
                arrives: *time,
                solution: bytes.iter().find_map(|&byte| receiver.push(byte)),
                ..Self::default()
            };
            let mut input = &bytes[..];
            if let Some(packet) = decoder.next(&mut input) {
                for item in packet.items() {
                    match item.decode() {
                        Ok(Item::PacketCounter(counter)) => sent.counter = counter,
                        Ok(Item::SampleTimeFine(ticks)) => sent.ticks = ticks,
                        Ok(Item::Quaternion(_, wxyz)) => sent.attitude_wxyz = Some(wxyz.to_f32()),
                        Ok(Item::RateOfTurn(turn)) => sent.turn = Some(turn.to_f32()),
                        Ok(Item::Acceleration(force)) => sent.force = Some(force.to_f32()),
                        Ok(Item::BaroPressure(pressure)) => sent.pressure = Some(pressure),
                        _ => {}
                    }
                }
            }
            sent
        });
        all.collect()
    }

    fn bytes(&self) -> Vec<u8> {
        let mut bytes = [0; LONGEST];
        let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
        let attitude =
            DataId::QUATERNION.with(CoordinateSystem::NorthWestUp, NumberFormat::Float32);
        // The buffer holds all items.
        let _ = writer.item(DataId::PACKET_COUNTER, &self.counter.to_be_bytes());
        let _ = writer.item(DataId::SAMPLE_TIME_FINE, &self.ticks.to_be_bytes());
        for (id, numbers) in [
            (attitude, self.attitude_wxyz.as_ref().map(|all| &all[..])),
            (DataId::RATE_OF_TURN, self.turn.as_ref().map(|all| &all[..])),
            (
                DataId::ACCELERATION,
                self.force.as_ref().map(|all| &all[..]),
            ),
        ] {
            if let Some(numbers) = numbers {
                let _ = writer.reals(id, numbers);
            }
        }
        if let Some(pressure) = self.pressure {
            let _ = writer.item(DataId::BARO_PRESSURE, &pressure.to_be_bytes());
        }
        let length = writer.finish().unwrap_or(0);
        let mut sent = self.noise.clone();
        sent.extend(bytes.get(..length).unwrap_or_default());
        if let Some(solution) = &self.solution {
            sent.extend(solution.encode());
        }
        sent
    }
}

/// A board in virtual time that keeps the estimates.
struct Bench {
    now: Cell<u64>,
    estimate: RefCell<Option<(Header, Estimate)>>,
}

impl Board for Bench {
    fn now(&self) -> u64 {
        self.now.get()
    }

    fn cycles(&self) -> u32 {
        0
    }

    fn stack_free(&self) -> u32 {
        0
    }

    fn line_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    fn feed_watchdog(&self) {}

    fn observe(&self, header: &Header, message: &Message) {
        if let Message::Estimate(estimate) = message {
            *self.estimate.borrow_mut() = Some((*header, *estimate));
        }
    }

    fn note(&self, _: u32) {}
}

/// An estimate with what it should have been.
#[derive(Debug, Clone, Copy)]
pub struct Judged {
    /// Time in the flight (s).
    pub time: f64,
    /// The estimate.
    pub estimate: Estimate,
    /// Its errors of attitude (rad, body axes), velocity (m/s) and, where it is known, muscle input.
    pub error: [[f32; 3]; 3],
    /// The stated deviations of these.
    pub deviation: [[f32; 3]; 3],
}

impl Judged {
    /// Whether it agrees with the measurements.
    pub fn is_consistent(&self) -> bool {
        is_consistent(&self.estimate)
    }

    /// The largest error in stated deviations, and its quantity.
    pub fn worst(&self) -> (f32, &'static str) {
        let names = ["attitude", "velocity", "muscle input"];
        let all = self.error.iter().zip(&self.deviation).zip(names);
        all.flat_map(|((error, deviation), name)| {
            error
                .iter()
                .zip(deviation)
                .map(move |(error, deviation)| (error.abs() / deviation, name))
        })
        .fold(
            (0.0, ""),
            |worst, new| {
                if new.0 > worst.0 { new } else { worst }
            },
        )
    }
}

/// Flies the unit's application with a flight's configuration and what was `sent`, and compares with what was flown.
///
/// # Panics
/// Same as [`estimates`].
pub fn fly(sensed: &Sensed, sent: &[Sent]) -> Vec<Judged> {
    let found = estimates(&sensed.setup, sent);
    let found = found.iter().filter_map(|told| judged(sensed, told));
    found.collect()
}

/// An estimate and all of its stated deviations.
#[derive(Debug, Clone, Copy)]
pub struct Told {
    /// Time in the flight (s).
    pub time: f64,
    /// The estimate.
    pub estimate: Estimate,
    /// In the order of [`bodyflight_core::estimator::motion::state`].
    pub deviation: [f32; STATES],
}

/// The estimates of the unit's application with a configuration and what was `sent`.
///
/// # Panics
/// Panics if the unit does not accept the configuration, or if an estimate is not finite.
pub fn estimates(setup: &Setup, sent: &[Sent]) -> Vec<Told> {
    let bench = Bench {
        now: Cell::new(0),
        estimate: RefCell::new(None),
    };
    let mut unit = Unit::new(bench, Identity::default());
    assert!(unit.resume(setup), "a usable configuration");
    let mut frame = [0; MAX_FRAME_LENGTH];
    let mut send = |unit: &mut Unit<Bench>, message: Option<Message>| {
        let header = Header {
            session: 0,
            sequence: 0,
            time: 0,
        };
        if let Some(message) = message {
            let length = message.encode(&header, &mut frame).unwrap_or(0);
            unit.receive(frame.get(..length).unwrap_or_default());
        }
        while unit.transmit(&mut frame).is_some() {}
    };
    let hello = Hello {
        schema_hash: SCHEMA_HASH,
        max_frame_length: u16::MAX,
    };
    send(&mut unit, Some(hello.into()));
    let mut found = Vec::new();
    let first = sent.first().map_or(0.0, |sent| sent.arrives);
    for sent in sent {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a time after the first"
        )]
        unit.board().now.set(((sent.arrives - first) * 1e6) as u64);
        send(&mut unit, sent.posture.map(Message::from));
        if sent.is_silent {
            continue;
        }
        for byte in sent.bytes() {
            unit.receive_sensor(&[byte]);
        }
        while unit.work() {}
        let estimate = unit.board().estimate.borrow_mut().take();
        let deviation = unit.computer().deviation();
        if let (Some((_, estimate)), Some(deviation)) = (estimate, deviation) {
            found.push(Told {
                time: sent.time,
                estimate,
                deviation,
            });
        }
    }
    assert_eq!(
        unit.status().estimates_bad,
        0,
        "estimates that are not finite"
    );
    found
}

fn judged(sensed: &Sensed, told: &Told) -> Option<Judged> {
    let Told {
        time,
        estimate,
        deviation,
    } = *told;
    let (velocity, attitude) = sensed.truth(time)?;
    let turn = estimate.inertial_from_body.unpack().inverse() * attitude;
    let miss = Vector3::from(estimate.velocity) - velocity;
    let [pitch, yaw, roll, ..] = estimate.state;
    let muscle = Vector3::new(pitch, yaw, roll) - Vector3::from(sensed.muscle).cast::<f32>();
    let group = |first: usize| [0, 1, 2].map(|k| deviation[first + k]);
    Some(Judged {
        time,
        estimate,
        error: [
            UnitQuaternion::scaled_axis(&turn).into(),
            miss.into(),
            muscle.into(),
        ],
        deviation: [group(ATTITUDE), group(VELOCITY), group(MUSCLE)],
    })
}

/// Longest time (s) in `within` for which estimates were consistent with an error beyond five of their deviations, and
/// the quantity.
pub fn longest_lie(found: &[Judged], within: &Range<f64>) -> (f64, &'static str) {
    let (mut longest, mut since) = ((0.0, ""), None);
    for judged in found.iter().filter(|judged| within.contains(&judged.time)) {
        let (ratio, name) = judged.worst();
        if judged.is_consistent() && ratio > 5.0 {
            let (begin, name) = *since.get_or_insert((judged.time, name));
            if judged.time - begin > longest.0 {
                longest = (judged.time - begin, name);
            }
        } else {
            since = None;
        }
    }
    longest
}
