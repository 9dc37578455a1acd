//! The driver on a simulated chip: registers, a measurement every 5 ms, and nothing before it was set up.
#![allow(clippy::float_cmp, reason = "counts of powers of two are exact")]

use core::cell::RefCell;
use core::convert::Infallible;
use core::sync::atomic::{AtomicU64, Ordering};
use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use bodyflight_core::link::Validity;
use bodyflight_core::xbus::Decoder;
use embassy_futures::block_on;
use embedded_hal::{digital, spi};
use nalgebra::Vector3;

use super::super::{Sensed, Sensor, reading::Reading};
use super::*;

struct Chip {
    registers: [u8; 128],
    selected: bool,
    heard: Vec<u8>,
    /// Time (us), and time of the next measurement.
    now: u64,
    next: u64,
    /// Counts of specific force and angular velocity.
    counts: [i16; 6],
}

#[derive(Clone)]
struct Pins(Rc<RefCell<Chip>>);

impl Pins {
    fn new(counts: [i16; 6]) -> Self {
        let mut chip = Chip {
            registers: [0; 128],
            selected: false,
            heard: Vec::new(),
            now: 0,
            next: 0,
            counts,
        };
        chip.reset();
        Self(Rc::new(RefCell::new(chip)))
    }

    fn find(&self) -> Option<Icm42688<Self, Self, Self>> {
        block_on(Icm42688::find(self.clone(), self.clone(), self.clone()))
    }
}

impl Chip {
    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[usize::from(IDENTITY)] = ICM_42688_P;
        // As after power-on: 1 kHz, both sensors off.
        self.registers[usize::from(GYROSCOPE_CONFIG)] = 0x06;
        self.registers[usize::from(ACCELEROMETER_CONFIG)] = 0x06;
    }

    fn exchange(&mut self, byte: u8) -> u8 {
        assert!(self.selected, "nobody is selected");
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

    fn pass(&mut self, micros: u64) {
        self.now += micros;
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

impl spi::ErrorType for Pins {
    type Error = Infallible;
}

impl SpiBus for Pins {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        let chip = &mut *self.0.borrow_mut();
        words.iter_mut().for_each(|word| *word = chip.exchange(0));
        Ok(())
    }
    fn write(&mut self, words: &[u8]) -> Result<(), Infallible> {
        let chip = &mut *self.0.borrow_mut();
        for word in words {
            chip.exchange(*word);
        }
        Ok(())
    }
    fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl digital::ErrorType for Pins {
    type Error = Infallible;
}

impl OutputPin for Pins {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().selected = true;
        Ok(())
    }
    fn set_high(&mut self) -> Result<(), Infallible> {
        let chip = &mut *self.0.borrow_mut();
        chip.selected = false;
        chip.heard.clear();
        Ok(())
    }
}

impl DelayNs for Pins {
    async fn delay_ns(&mut self, time: u32) {
        self.0.borrow_mut().pass(u64::from(time / 1000));
    }
}

#[test]
fn counts_are_read_in_units() {
    let pins = Pins::new([2048, -4096, 1024, 164, -1640, 16_400]);
    let mut chip = pins.find().unwrap();
    let measured = block_on(chip.measure()).unwrap();
    let expected = [GRAVITY, -2.0 * GRAVITY, 0.5 * GRAVITY];
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
        let pins = Pins::new([0; 6]);
        assert!(block_on(Icm42688::find(Other(identity), pins.clone(), pins)).is_none());
    }
}

/// A bus on which every byte that is read is the same.
struct Other(u8);

impl spi::ErrorType for Other {
    type Error = Infallible;
}

impl SpiBus for Other {
    fn read(&mut self, words: &mut [u8]) -> Result<(), Infallible> {
        words.fill(self.0);
        Ok(())
    }
    fn write(&mut self, _: &[u8]) -> Result<(), Infallible> {
        Ok(())
    }
    fn transfer(&mut self, _: &mut [u8], _: &[u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn transfer_in_place(&mut self, _: &mut [u8]) -> Result<(), Infallible> {
        unreachable!("not used")
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[test]
fn a_sensor_that_has_not_started_is_not_believed() {
    let pins = Pins::new([0, 0, 2048, INVALID, INVALID, INVALID]);
    let mut chip = pins.find().unwrap();
    assert_eq!(block_on(chip.measure()), Err(ChipError::Silent));
    pins.0.borrow_mut().counts = [0, 0, 2048, 0, 0, 0];
    assert!(block_on(chip.measure()).is_ok());
}

/// The bytes of `count` reads of up to 20 bytes.
fn bytes(port: &mut Port<Pins, Pins, Pins>, count: usize) -> Vec<Result<Vec<u8>, ChipError>> {
    let read = |_| {
        let mut bytes = vec![0; 20];
        let read = block_on(port.read(&mut bytes));
        read.map(|count| bytes[..count].to_vec())
    };
    (0..count).map(read).collect()
}

#[test]
fn its_packets_are_those_of_a_sensor_without_an_orientation() {
    let pins = Pins::new([0, 0, 2048, 164, 0, 0]);
    let mut port = Port::new(pins.find().unwrap(), || 1_234_500);
    let line = bytes(&mut port, 9).into_iter().flatten().flatten();
    let line: Vec<u8> = line.collect();
    let mut decoder = Decoder::<64>::new();
    let mut input = line.as_slice();
    for counter in 0..3 {
        let reading = Reading::of(&decoder.next(&mut input).unwrap());
        assert_eq!(reading.counter, Some(counter));
        assert_eq!(reading.fine_time, Some(12_345));
        assert!(reading.inertial_from_sensor.is_none());
        assert_eq!(reading.specific_force.unwrap().z, GRAVITY);
        assert!((reading.angular_velocity.unwrap().x.to_degrees() - 10.0).abs() < 1e-4);
    }
}

#[test]
fn a_chip_that_lost_its_supply_is_set_up_again() {
    let pins = Pins::new([0, 0, 2048, 0, 0, 0]);
    let mut port = Port::new(pins.find().unwrap(), || 0);
    assert!(bytes(&mut port, 3).iter().all(Result::is_ok));
    pins.0.borrow_mut().reset();
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
    let pins = Pins::new([0, 2048, 0, 8, -8, 0]);
    let mut port = Port::new(pins.find().unwrap(), ticking);
    let mut sensor = Sensor::new();
    let mut samples = Vec::new();
    for piece in bytes(&mut port, 900).into_iter().flatten() {
        samples.extend(sensor.next(&mut piece.as_slice(), 0));
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
