//! The driver on a simulated chip: registers, a measurement every 5 ms, and nothing before it was set up.
#![allow(clippy::float_cmp, reason = "counts of powers of two are exact")]

use core::sync::atomic::{AtomicU64, Ordering};
use std::vec;
use std::vec::Vec;

use bodyflight_core::link::Validity;
use bodyflight_core::xbus::Decoder;
use embassy_futures::block_on;
use nalgebra::Vector3;

use super::super::{Sensed, Sensor, reading::Reading};
use super::*;
use crate::test_spi::{Chip, Pins};

pub(crate) struct Simulated {
    registers: [u8; 128],
    heard: Vec<u8>,
    /// Time (us), and time of the next measurement.
    now: u64,
    next: u64,
    /// Counts of specific force and angular velocity.
    counts: [i16; 6],
}

/// A chip that measures these counts.
pub(crate) fn chip(counts: [i16; 6]) -> Pins<Simulated> {
    let mut chip = Simulated {
        registers: [0; 128],
        heard: Vec::new(),
        now: 0,
        next: 0,
        counts,
    };
    chip.reset();
    Pins::new(chip)
}

type Found<C> = Icm42688<Pins<C>, Pins<C>, Pins<C>>;

fn find<C: Chip>(pins: &Pins<C>) -> Option<Found<C>> {
    block_on(Icm42688::find(pins.clone(), pins.clone(), pins.clone()))
}

impl Simulated {
    pub(crate) fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[usize::from(IDENTITY)] = ICM_42688_P;
        // As after power-on: 1 kHz, both sensors off.
        self.registers[usize::from(GYROSCOPE_CONFIG)] = 0x06;
        self.registers[usize::from(ACCELEROMETER_CONFIG)] = 0x06;
    }
}

impl Chip for Simulated {
    fn exchange(&mut self, byte: u8) -> u8 {
        self.heard.push(byte);
        let [first, rest @ ..] = &self.heard[..] else {
            return 0;
        };
        let register = usize::from(first & !READ) + rest.len().saturating_sub(1);
        if rest.is_empty() {
            return 0;
        }
        if first & READ == 0 {
            self.registers[register] = byte;
            if register == usize::from(DEVICE_CONFIG) {
                self.reset();
            }
            return 0;
        }
        let value = self.registers[register];
        if register == usize::from(INTERRUPT_STATUS) {
            self.registers[register] = 0;
        }
        value
    }

    fn deselect(&mut self) {
        self.heard.clear();
    }

    fn pass(&mut self, micros: u32) {
        self.now += u64::from(micros);
        let settings = [GYROSCOPE_CONFIG, ACCELEROMETER_CONFIG, POWER];
        let [gyroscope, accelerometer, power] = settings.map(|k| self.registers[usize::from(k)]);
        if power != ON || self.now < self.next {
            return;
        }
        assert_eq!([gyroscope, accelerometer], [0x07, 0x07]);
        self.next = self.now + 5_000;
        let words = self.counts.iter().flat_map(|count| count.to_be_bytes());
        for (place, byte) in self.registers[0x1f..].iter_mut().zip(words) {
            *place = byte;
        }
        self.registers[usize::from(INTERRUPT_STATUS)] |= READY;
    }
}

#[test]
fn counts_are_read_in_units() {
    let pins = chip([2048, -4096, 1024, 164, -1640, 16_400]);
    let mut chip = find(&pins).unwrap();
    let measured = block_on(chip.measure()).unwrap();
    let expected = [
        STANDARD_GRAVITY,
        -2.0 * STANDARD_GRAVITY,
        0.5 * STANDARD_GRAVITY,
    ];
    assert_eq!(measured.specific_force, expected);
    for (turn, degrees) in measured
        .angular_velocity
        .iter()
        .zip([10.0, -100.0, 1000.0_f32])
    {
        assert!((turn - degrees.to_radians()).abs() < 1e-5, "{turn}");
    }
}

#[test]
fn another_chip_or_none_is_not_taken_for_one() {
    for identity in [0, 0xff, 0x12] {
        assert!(find(&Pins::new(Other(identity))).is_none());
    }
}

/// A bus on which every byte that is read is the same.
struct Other(u8);

impl Chip for Other {
    fn exchange(&mut self, _: u8) -> u8 {
        self.0
    }

    fn deselect(&mut self) {}

    fn pass(&mut self, _: u32) {}
}

#[test]
fn a_sensor_that_has_not_started_is_not_believed() {
    let pins = chip([0, 0, 2048, INVALID, INVALID, INVALID]);
    let mut chip = find(&pins).unwrap();
    assert_eq!(block_on(chip.measure()), Err(ChipError::Silent));
    pins.chip.borrow_mut().counts = [0, 0, 2048, 0, 0, 0];
    assert!(block_on(chip.measure()).is_ok());
}

/// The bytes of `count` reads of up to 20 bytes.
fn bytes(
    port: &mut Port<Pins<Simulated>, Pins<Simulated>, Pins<Simulated>>,
    count: usize,
) -> Vec<Result<Vec<u8>, ChipError>> {
    let read = |_| {
        let mut bytes = vec![0; 20];
        let read = block_on(port.read(&mut bytes));
        read.map(|count| bytes[..count].to_vec())
    };
    (0..count).map(read).collect()
}

#[test]
fn its_packets_are_those_of_a_sensor_without_an_orientation() {
    let pins = chip([0, 0, 2048, 164, 0, 0]);
    let mut port = Port::new(find(&pins).unwrap(), || 1_234_500);
    let line = bytes(&mut port, 9).into_iter().flatten().flatten();
    let line: Vec<u8> = line.collect();
    let mut decoder = Decoder::<64>::new();
    let mut input = line.as_slice();
    for counter in 0..3 {
        let reading = Reading::of(&decoder.next(&mut input).unwrap());
        assert_eq!(reading.counter, Some(counter));
        assert_eq!(reading.fine_time, Some(12_345));
        assert!(reading.inertial_from_sensor.is_none());
        assert_eq!(reading.specific_force.unwrap().z, STANDARD_GRAVITY);
        assert!((reading.angular_velocity.unwrap().x.to_degrees() - 10.0).abs() < 1e-4);
    }
}

#[test]
fn a_chip_that_lost_its_supply_is_set_up_again() {
    let pins = chip([0, 0, 2048, 0, 0, 0]);
    let mut port = Port::new(find(&pins).unwrap(), || 0);
    assert!(bytes(&mut port, 3).iter().all(Result::is_ok));
    pins.chip.borrow_mut().reset();
    assert_eq!(bytes(&mut port, 1), [Err(ChipError::Silent)]);
    assert!(bytes(&mut port, 3).iter().all(Result::is_ok));
}

/// A clock that advances by the interval of the measurements at each look.
fn ticking() -> u64 {
    static NOW: AtomicU64 = AtomicU64::new(0);
    NOW.fetch_add(5_000, Ordering::Relaxed)
}

#[test]
fn a_still_chip_is_level_after_a_second() {
    // On its side, with a bias of half a degree per second.
    let pins = chip([0, 2048, 0, 8, -8, 0]);
    let mut port = Port::new(find(&pins).unwrap(), ticking);
    let mut sensor = Sensor::new();
    let mut samples = Vec::new();
    for piece in bytes(&mut port, 900).into_iter().flatten() {
        samples.extend(sensor.next(&mut piece.as_slice(), 0, None));
    }
    let level = |sensed: &&Sensed| sensed.sample.valid.contains(Validity::ATTITUDE);
    assert_eq!(samples.len(), 300);
    assert!((98..=100).contains(&samples.iter().filter(level).count()));
    let sample = samples.last().unwrap().sample;
    let up = *sample.inertial_from_body().quaternion() * Vector3::y();
    assert!((up - Vector3::z()).norm() < 1e-3, "{up}");
    let turn = sample.motion().angular_velocity.unwrap().to_array();
    assert!(turn.iter().all(|turn| turn.abs() < 1e-5), "{turn:?}");
}
