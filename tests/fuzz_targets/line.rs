//! The serial lines of the unit and its sensor.

use std::cell::Cell;
use std::sync::OnceLock;

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{
    self, Configure, Header, LimbTable, MAX_FRAME_LENGTH, Message, Sample, SegmentTable, Setup,
    Start, Stop, StreamMode, TimeSync, Validity,
};
use bodyflight_core::xbus::{DataId, Decoder, MAX_PACKET_LENGTH, MessageId, PacketWriter};
use bodyflight_firmware::{Board, Identity, Unit};
use nalgebra::{UnitQuaternion, Vector3};

use super::choices::Choices;
use crate::greeting::{configure, hello};

/// A board whose clock is set by the input.
#[derive(Debug, Default)]
struct Bench(Cell<u64>);

impl Board for Bench {
    fn now(&self) -> u64 {
        self.0.get()
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
    fn note(&self, _: u32) {}
}

/// Packets of a sensor are the same whether the bytes arrive at once or one by one.
pub(super) fn xbus(input: &[u8]) {
    let mut at_once = Decoder::<512>::new();
    let mut found = Vec::new();
    let mut rest = input;
    while let Some(packet) = at_once.next(&mut rest) {
        for item in packet.items() {
            // Decoding and refusing are both correct.
            let _ = item.decode();
        }
        found.push((packet.message_id, packet.data.to_vec()));
    }
    let mut one_by_one = Decoder::<512>::new();
    let mut again = Vec::new();
    for byte in input {
        let mut rest = core::slice::from_ref(byte);
        while let Some(packet) = one_by_one.next(&mut rest) {
            again.push((packet.message_id, packet.data.to_vec()));
        }
    }
    assert_eq!(found, again);
    assert_eq!(at_once.counters(), one_by_one.counters());
}

/// Most samples per input that reach the filter, which is the slow part.
const MOST_SAMPLES: u32 = 16;

/// The unit in virtual time: commands in any order, frames and samples damaged as the input chooses, noise in between.
/// In all cases its frames are whole, its estimates finite, and its queue within its capacity.
pub(super) fn unit(input: &[u8]) {
    let mut choices = Choices(input);
    let mut host = Host::new();
    if choices.byte() & 1 == 1 {
        host.begin();
    }
    while !choices.is_empty() {
        host.act(&mut choices);
        host.listen();
    }
    host.end();
    let status = host.unit.status();
    assert!(status.queue_high_water <= bodyflight_firmware::unit::SAMPLES.into());
}

/// A host that sends valid and invalid messages.
pub(super) struct Host {
    unit: Unit<Bench>,
    table: SegmentTable,
    sample: Sample,
    header: Header,
    worked: u32,
    /// Clock of the unit's own sensor (100 us).
    clock: u32,
}

impl Host {
    pub(super) fn new() -> Self {
        // The same for every input.
        static TABLE: OnceLock<SegmentTable> = OnceLock::new();
        let table = TABLE.get_or_init(|| {
            let body = Person::new(1.75, 75.0, Sex::Male).body().expect("a body");
            SegmentTable::of(&body, &Aerodynamics::paper())
        });
        let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), 1.5);
        let seen = link::Motion {
            angular_velocity: Some(Vector::zero()),
            velocity: Some(Vector::new(2.0, 0.0, -50.0)),
            horizontal_speed: None,
        };
        Self {
            unit: Unit::new(Bench::default(), Identity::default()),
            table: *table,
            sample: Sample::new(
                &pattern::neutral(),
                &Rotation::from_quaternion(belly),
                &seen,
            ),
            header: Header {
                session: 9,
                ..Header::default()
            },
            worked: 0,
            clock: 0,
        }
    }

    /// A configuration that a unit may keep.
    pub(super) fn setup(&self) -> Setup {
        Setup {
            configure: configure(0, &self.table),
            table: self.table,
            limbs: LimbTable::new(),
        }
    }

    /// Sample `number` of a flight without a velocity, all of which a unit logs.
    pub(super) fn numbered(&self, number: u32) -> (Header, Message) {
        let header = Header {
            sequence: number,
            time: u64::from(number) * 4167,
            ..self.header
        };
        let mut sample = self.sample;
        sample.valid.remove(Validity::VELOCITY);
        (header, sample.into())
    }

    /// Starts the unit with a stored configuration; returns whether it was accepted.
    pub(super) fn resume(&mut self, setup: &Setup) -> bool {
        self.unit.resume(setup)
    }

    /// A packet of the unit's own sensor, of numbers that the input chooses.
    pub(super) fn sense(&mut self, choices: &mut Choices<'_>) {
        self.clock = self.clock.wrapping_add(100);
        let step = 10_000 << (choices.byte() % 16);
        let clock = &self.unit.board().0;
        clock.set(clock.get().saturating_add(step));
        let mut numbers = || {
            [(); 4].map(|()| {
                let [low, high] = choices.word().to_le_bytes();
                f32::from_bits(u32::from_le_bytes([0, 0, low, high]))
            })
        };
        let [attitude, rate, force] = [numbers(), numbers(), numbers()];
        let mut bytes = [0; MAX_PACKET_LENGTH];
        let mut writer = PacketWriter::new(&mut bytes, MessageId::MT_DATA2);
        let written = writer
            .item(DataId::SAMPLE_TIME_FINE, &self.clock.to_be_bytes())
            .and_then(|()| writer.reals(DataId::QUATERNION, &attitude))
            .and_then(|()| writer.reals(DataId::RATE_OF_TURN, &rate[..3]))
            .and_then(|()| writer.reals(DataId::ACCELERATION, &force[..3]));
        let length = written.and_then(|()| writer.finish()).expect("it fits");
        self.unit.receive_sensor(&bytes[..length]);
        if self.worked < MOST_SAMPLES {
            self.worked += u32::from(self.unit.work());
        }
        self.listen();
    }

    /// Lets the unit work off its queue.
    pub(super) fn end(&mut self) {
        while self.unit.work() {}
        self.listen();
    }

    /// Sends all messages up to the start of a session.
    fn begin(&mut self) {
        for message in self.greeting(0, 240.0, 60.0) {
            self.send(message, None);
        }
        let mode = StreamMode::Paced;
        self.send(Start { mode }.into(), None);
    }

    fn greeting(&self, preset: u8, sample_rate: f32, update_rate: f32) -> Vec<Message> {
        let mut messages = vec![
            Message::from(hello()),
            Message::from(Configure {
                sample_rate,
                update_rate,
                ..configure(preset.into(), &self.table)
            }),
        ];
        messages.extend(self.table.rows().map(|row| Message::from(*row)));
        messages
    }

    /// Sends a frame, with one byte changed if requested.
    fn send(&mut self, message: Message, damage: Option<(u8, u8)>) {
        let mut bytes = [0; MAX_FRAME_LENGTH];
        let length = message.encode(&self.header, &mut bytes).expect("it fits");
        let frame = &mut bytes[..length];
        if let Some((place, change)) = damage {
            frame[usize::from(place) % length] ^= change;
        }
        self.unit.receive(frame);
    }

    fn act(&mut self, choices: &mut Choices<'_>) {
        let action = choices.byte();
        let damage = (action & 0x80 != 0).then(|| (choices.byte(), choices.byte()));
        match action & 0x0F {
            0 => {
                let length = usize::from(choices.byte());
                self.unit.receive(choices.bytes(length));
            }
            1 => {
                let length = usize::from(choices.byte());
                self.unit.receive_sensor(choices.bytes(length));
            }
            2 => self.begin(),
            3 => {
                let [preset, rate, ratio] = [(); 3].map(|()| choices.byte());
                let rate = f32::from(rate) * 4.0;
                let update = rate / f32::from(ratio.max(1));
                let all = self.greeting(preset, rate, update);
                all.into_iter()
                    .for_each(|message| self.send(message, damage));
            }
            4 => {
                let mode = match choices.byte() % 3 {
                    0 => StreamMode::Paced,
                    1 => StreamMode::Credit,
                    _ => StreamMode::Sensor,
                };
                self.header.session = self.header.session.wrapping_add(1);
                self.send(Start { mode }.into(), damage);
            }
            5 => {
                let sent = self.header.sequence;
                self.send(Stop { sent }.into(), damage);
            }
            6 => self.header.sequence = self.header.sequence.wrapping_add(choices.word().into()),
            7 => self.header.sequence = u32::MAX - u32::from(choices.byte()),
            8 => {
                let step = u64::from(choices.word()) << (choices.byte() % 48);
                let clock = &self.unit.board().0;
                clock.set(clock.get().saturating_add(step));
            }
            9 => self.unit.line_error(),
            10 => {
                let question = TimeSync {
                    asked: self.header.time,
                    received: 0,
                    answered: 0,
                };
                self.send(question.into(), damage);
            }
            11 => {
                self.unit.feed_watchdog();
                self.unit.report();
            }
            _ => {
                self.header.time = self
                    .header
                    .time
                    .wrapping_add(u64::from(choices.byte()) * 100);
                let sample = self.sample;
                self.send(sample.into(), damage);
                self.header.sequence = self.header.sequence.wrapping_add(1);
                if self.worked < MOST_SAMPLES {
                    self.worked += u32::from(self.unit.work());
                }
            }
        }
    }

    /// Asserts that every frame of the unit is whole, and that its estimates are finite.
    fn listen(&mut self) {
        let mut bytes = [0; MAX_FRAME_LENGTH];
        while let Some(length) = self.unit.transmit(&mut bytes) {
            let (_, message) = Message::decode(&bytes[..length]).expect("a whole frame");
            if let Message::Estimate(estimate) = message {
                assert!(estimate.state.iter().all(|value| value.is_finite()));
                assert!(estimate.variance.iter().all(|value| *value >= 0.0));
            }
        }
    }
}
