//! A long flight in virtual time: books that balance, and clocks and counters that wrap without a trace.
//!
//! Two units are given the same samples. One starts with all its clocks at zero; the clocks of the other wrap while it flies:
//! milliseconds and microseconds of 32 bits, and the counter of cycles, which a processor at 168 MHz wraps every 26 s. What
//! they say must be the same. `BODYFLIGHT_SOAK_HOURS=24 cargo test --release -p bodyflight-tests --test unit_soak -- --nocapture`
//! flies a day.
#![allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]

use std::cell::Cell;

use bodyflight_core::aerodynamics::Aerodynamics;
use bodyflight_core::body::anthropometry::{Person, Sex};
use bodyflight_core::body::pattern;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::link::{
    self, Estimate, Header, MAX_FRAME_LENGTH, Message, Sample, SegmentTable, Start, Stop,
    StreamMode,
};
use bodyflight_firmware::{Board, Identity, Unit};
use bodyflight_tests::greeting::{configure, hello};
use nalgebra::{UnitQuaternion, Vector3};

const RATE: u64 = 240;
const SESSION: u16 = 11;
/// Cycles of every update, more than one is given.
const CYCLES: u32 = 312_345;
/// Flight where the environment asks for none (h).
const HOURS: f64 = 0.1;
/// Every so many samples one is lost, comes twice, or comes behind the next.
const LOST: u32 = 997;
const TWICE: u32 = 1009;
const SWAPPED: u32 = 1013;

/// A board whose clocks begin anywhere.
struct Bench {
    now: Cell<u64>,
    cycles: Cell<u32>,
}

impl Board for Bench {
    fn now(&self) -> u64 {
        self.now.get()
    }
    fn cycles(&self) -> u32 {
        self.cycles.replace(self.cycles.get().wrapping_add(CYCLES))
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

/// What a unit says after a sample.
#[derive(Debug, Default, PartialEq)]
struct Said {
    estimates: Vec<Estimate>,
}

struct Flying {
    unit: Unit<Bench>,
    /// The unit's clock and the sensor's when it started (us).
    began: u64,
    sensor: u64,
    second: u64,
}

impl Flying {
    fn new(began: u64, sensor: u64, cycles: u32) -> Self {
        let bench = Bench {
            now: Cell::new(began),
            cycles: Cell::new(cycles),
        };
        let mut flying = Self {
            unit: Unit::new(bench, Identity::default()),
            began,
            sensor,
            second: 0,
        };
        let body = Person::new(1.75, 75.0, Sex::Male).body().unwrap();
        let table = SegmentTable::of(&body, &Aerodynamics::paper());
        flying.tell(0, hello());
        flying.tell(0, configure(0, &table));
        for row in table.rows() {
            flying.tell(0, *row);
        }
        let mode = StreamMode::Paced;
        flying.tell(0, Start { mode });
        flying.heard();
        flying
    }

    fn tell(&mut self, sequence: u32, message: impl Into<Message>) {
        let header = Header {
            session: SESSION,
            sequence,
            time: self.sensor + u64::from(sequence) * 1_000_000 / RATE,
        };
        let mut frame = [0; MAX_FRAME_LENGTH];
        let length = message.into().encode(&header, &mut frame).unwrap();
        self.unit.receive(&frame[..length]);
    }

    fn heard(&mut self) -> Said {
        let mut bytes = [0; MAX_FRAME_LENGTH];
        let mut said = Said::default();
        while let Some(length) = self.unit.transmit(&mut bytes) {
            if let (_, Message::Estimate(estimate)) = Message::decode(&bytes[..length]).unwrap() {
                said.estimates.push(estimate);
            }
        }
        said
    }

    /// Gives the unit a sample, faults of the line included.
    fn sample(&mut self, number: u32) -> Said {
        let since = u64::from(number) * 1_000_000 / RATE;
        self.unit.board().now.set(self.began + since);
        match number {
            n if n % LOST == 5 => {}
            n if n % SWAPPED == 7 => {
                self.tell(n + 1, sample(n + 1));
                self.tell(n, sample(n));
            }
            // It came before the one before it.
            n if n % SWAPPED == 8 => {}
            n => self.tell(n, sample(n)),
        }
        if number % TWICE == 11 {
            self.tell(number, sample(number));
        }
        while self.unit.work() {}
        if since / 1_000_000 > self.second {
            self.second += 1;
            assert_eq!(self.unit.report().uptime, self.began + since);
        }
        self.heard()
    }
}

/// A wearer in belly flight who sways, without end.
fn sample(number: u32) -> Sample {
    let time = f64::from(number % (RATE as u32 * 60)) / RATE as f64;
    let wave = |period: f64| (core::f64::consts::TAU * time / period).sin_cos();
    let ((sway, change), (drift, _)) = (wave(7.5), wave(20.0));
    #[expect(
        clippy::cast_possible_truncation,
        reason = "single precision on the wire"
    )]
    let single = |value: f64| value as f32;
    let pitch = single(1.5 + 0.05 * sway);
    let turn = single(0.05 * core::f64::consts::TAU / 7.5 * change);
    let attitude = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch);
    let motion = link::Motion {
        angular_velocity: Some(Vector::new(turn, 0.0, 0.0)),
        velocity: Some(Vector::new(single(2.0 + drift), 0.0, -50.0)),
        horizontal_speed: None,
    };
    let posture = pattern::moved(
        &pattern::neutral(),
        pattern::DRAW_IN_LEFT,
        single(0.1 * drift),
    );
    Sample::new(&posture, &Rotation::from_quaternion(attitude), &motion)
}

#[test]
fn a_long_flight_leaves_no_trace_of_its_length() {
    let hours =
        std::env::var("BODYFLIGHT_SOAK_HOURS").map_or(HOURS, |hours| hours.parse().unwrap());
    let samples = (hours * 3600.0) as u32 * RATE as u32;
    let wrap = 1_u64 << 32;
    let mut plain = Flying::new(0, 0, 0);
    let mut wrapping = Flying::new(wrap * 1000 - 60_000_000, wrap - 30_000_000, u32::MAX - 7);
    let mut estimates = 0_u32;
    for number in 0..samples {
        let said = plain.sample(number);
        assert_eq!(said, wrapping.sample(number), "sample {number}");
        for estimate in said.estimates {
            estimates += 1;
            assert_eq!(estimate.cycles, CYCLES);
            assert!(
                estimate.variance.iter().all(|v| (0.0..1e6).contains(v)),
                "{estimate:?}"
            );
        }
    }
    let every = |period: u32, phase: u32| (samples + period - 1 - phase) / period;
    for flying in [&mut plain, &mut wrapping] {
        flying.tell(samples, Stop { sent: samples });
        let status = flying.unit.status();
        let known = [
            status.used,
            status.rejected,
            status.dropped_oldest,
            status.late,
            status.missing,
        ];
        assert_eq!(known.iter().sum::<u32>(), samples, "{status:?}");
        assert_eq!((status.rejected, status.dropped_oldest), (0, 0));
        // One that is lost may be the one that is swapped, so some are both.
        let lost = every(LOST, 5);
        assert!(
            status.missing.abs_diff(lost) <= 2 + samples / 100_000,
            "{status:?}"
        );
        assert!(
            status.late.abs_diff(every(SWAPPED, 7)) <= 2 + samples / 100_000,
            "{status:?}"
        );
        assert_eq!(status.deadline_missed, 0);
    }
    assert!(
        estimates.abs_diff(samples / 4) <= samples / 100,
        "{estimates}"
    );
    let ledger = plain.unit.status();
    println!(
        "{hours} h: {samples} samples, {} used, {} missing, {} late, {} duplicate; {estimates} estimates, all equal",
        ledger.used, ledger.missing, ledger.late, ledger.duplicate
    );
}
