//! A long flight in virtual time: ledgers that balance, clocks and counters that wrap without effect, and estimates
//! that stay as good as at the beginning.
//!
//! Two units with the motion filter receive the same samples. One starts with all clocks at zero. The clocks of the
//! other wrap during the flight: sequence numbers, milliseconds and microseconds of 32 bits, and the cycle counter,
//! which wraps every 26 s at 168 MHz. Their answers must be the same. `cargo xtask soak --hours 24` simulates a day.
#![allow(clippy::cast_possible_truncation, reason = "small numbers of a test")]

mod unit_soak {
    pub mod quality;
    pub mod wearer;
}

use std::cell::Cell;

use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::estimator::unit_preset::UnitPreset;
use bodyflight_core::link::{
    Estimate, Header, MAX_FRAME_LENGTH, Message, ResetFilter, Sample, Start, Status, Stop,
    StreamMode,
};
use bodyflight_firmware::{Board, Identity, Unit};
use bodyflight_tests::arm_swing::RATE;
use bodyflight_tests::greeting::{configure, hello};
use unit_soak::quality::Quality;
use unit_soak::wearer::Wearer;

const SESSION: u16 = 11;
/// Cycles that every update appears to take, more than a real one may take.
const CYCLES: u32 = 312_345;
/// Default duration of the flight (h).
const HOURS: f64 = 0.1;
/// Number of parts of the flight that are evaluated separately.
const PARTS: u32 = 6;
/// One sample in this many is lost, sent twice, or swapped with the next.
const LOST: u32 = 997;
const TWICE: u32 = 1009;
const SWAPPED: u32 = 1013;

/// A board whose clocks start at any value.
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

/// Initial values of clocks and counters.
#[derive(Debug, Clone, Copy, Default)]
struct Origin {
    /// The unit's clock and the sensor's (us).
    clock: u64,
    sensor: u64,
    cycles: u32,
    /// Number of the first sample of the flight.
    sequence: u32,
}

impl Origin {
    /// Milliseconds wrap after a minute, the sensor's microseconds after half a minute, sequence numbers after 20 s,
    /// and cycles at once.
    fn about_to_wrap() -> Self {
        let wrap = 1_u64 << 32;
        Self {
            clock: wrap * 1000 - 60_000_000,
            sensor: wrap - 30_000_000,
            cycles: u32::MAX - 7,
            sequence: 0_u32.wrapping_sub(20 * RATE),
        }
    }
}

struct Flying {
    unit: Unit<Bench>,
    origin: Origin,
    second: u64,
}

impl Flying {
    fn new(origin: Origin, first: Sample) -> Self {
        let bench = Bench {
            now: Cell::new(origin.clock),
            cycles: Cell::new(origin.cycles),
        };
        let mut flying = Self {
            unit: Unit::new(bench, Identity::default()),
            origin,
            second: 0,
        };
        let preset = UnitPreset::number("auto", &BACK_TRACKING).unwrap();
        let table = Wearer::table();
        flying.tell(0, hello());
        flying.tell(0, configure(preset as u16, &table));
        for row in table.rows() {
            flying.tell(0, *row);
        }
        let mode = StreamMode::Paced;
        flying.tell(0, Start { mode });
        flying.go_ahead(first);
        flying
    }

    /// Advances to the first sequence number of the flight, in steps that wrapping arithmetic does not mistake for
    /// steps back.
    fn go_ahead(&mut self, first: Sample) {
        let ahead = self.origin.sequence;
        if ahead > 0 {
            for number in [ahead / 2, ahead - 1] {
                self.tell(number.wrapping_sub(ahead), first);
                assert!(self.unit.work());
                self.tell(0, ResetFilter {});
            }
        }
        self.heard();
    }

    /// Sends a message; `number` is counted from the first sample of the flight.
    fn tell(&mut self, number: u32, message: impl Into<Message>) {
        let since = u64::from(number.cast_signed().max(0).cast_unsigned());
        let header = Header {
            session: SESSION,
            sequence: number.wrapping_add(self.origin.sequence),
            time: self.origin.sensor + since * 1_000_000 / u64::from(RATE),
        };
        let mut frame = [0; MAX_FRAME_LENGTH];
        let length = message.into().encode(&header, &mut frame).unwrap();
        self.unit.receive(&frame[..length]);
    }

    /// Estimates with their times, both relative to the initial clocks and numbers.
    fn heard(&mut self) -> Vec<(u64, Estimate)> {
        let mut bytes = [0; MAX_FRAME_LENGTH];
        let mut estimates = Vec::new();
        while let Some(length) = self.unit.transmit(&mut bytes) {
            let read = Message::decode(&bytes[..length]).unwrap();
            if let (header, Message::Estimate(mut estimate)) = read {
                let Origin {
                    sensor, sequence, ..
                } = self.origin;
                estimate.sample_sequence = estimate.sample_sequence.wrapping_sub(sequence);
                estimates.push((header.time - sensor, estimate));
            }
        }
        estimates
    }

    /// Sends the unit sample number `number`, which is `here`, with the line's faults; `next` is sent first if the two
    /// are swapped.
    fn sample(&mut self, number: u32, [here, next]: [Sample; 2]) -> Vec<(u64, Estimate)> {
        let since = u64::from(number) * 1_000_000 / u64::from(RATE);
        let now = self.origin.clock + since;
        self.unit.board().now.set(now);
        match number {
            n if n % LOST == 5 => {}
            n if n % SWAPPED == 7 => {
                self.tell(n + 1, next);
                self.tell(n, here);
            }
            // It was sent before its predecessor.
            n if n % SWAPPED == 8 => {}
            n => self.tell(n, here),
        }
        if number % TWICE == 11 {
            self.tell(number, here);
        }
        while self.unit.work() {}
        if since / 1_000_000 > self.second {
            self.second += 1;
            assert_eq!(self.unit.report().uptime, now);
        }
        self.heard()
    }

    /// Ends the flight after this many samples; the ledger must balance.
    fn finish(&mut self, samples: u32) -> Status {
        let sent = samples.wrapping_add(self.origin.sequence);
        self.tell(samples, Stop { sent });
        let status = self.unit.status();
        assert_eq!(status.accounted(), sent, "{status:?}");
        assert_eq!((status.rejected, status.dropped_oldest), (0, 0));
        assert_eq!(status.deadline_missed, 0);
        status
    }
}

#[test]
fn a_long_flight_leaves_no_trace_of_its_length() {
    let hours =
        std::env::var("BODYFLIGHT_SOAK_HOURS").map_or(HOURS, |hours| hours.parse().unwrap());
    let samples = (hours * 3600.0) as u32 * RATE;
    let mut wearer = Wearer::new();
    let mut here = wearer.sample();
    let mut plain = Flying::new(Origin::default(), here);
    let mut wrapping = Flying::new(Origin::about_to_wrap(), here);
    let mut parts = [Quality::default(); PARTS as usize];
    for number in 0..samples {
        let next = wearer.sample();
        let said = plain.sample(number, [here, next]);
        let other = wrapping.sample(number, [here, next]);
        assert_eq!(said, other, "sample {number}");
        let part = u64::from(number) * u64::from(PARTS) / u64::from(samples);
        for (_, estimate) in said {
            assert_eq!(estimate.cycles, CYCLES);
            parts[part as usize].take(&estimate, &Wearer::truth());
        }
        here = next;
    }
    let status = plain.finish(samples);
    let wrapped = wrapping.finish(samples);
    check_ledger(samples, &status);
    // The two samples sent before the flight, and the numbers they skipped.
    let skipped = Origin::about_to_wrap().sequence - 2;
    assert_eq!(wrapped.used, status.used + 2);
    assert_eq!(wrapped.missing, status.missing.wrapping_add(skipped));
    assert_eq!(
        (wrapped.late, wrapped.duplicate),
        (status.late, status.duplicate)
    );
    let table = table(hours, samples, &status, &parts);
    println!("{table}");
    if let Some(path) = std::env::var_os("BODYFLIGHT_SOAK_TABLE") {
        std::fs::write(path, table).unwrap();
    }
    let estimates: u32 = parts.iter().map(|part| part.estimates).sum();
    assert!(
        estimates.abs_diff(samples / 4) <= samples / 100,
        "{estimates}"
    );
    for part in &parts {
        part.check(&parts[0]);
    }
}

/// Asserts that the ledger counts lost, swapped and duplicated samples correctly.
fn check_ledger(samples: u32, status: &Status) {
    let every = |period: u32, phase: u32| (samples + period - 1 - phase) / period;
    // A lost sample may also be due for swapping, so some are both.
    let slack = 2 + samples / 100_000;
    for (found, expected) in [
        (status.missing, every(LOST, 5)),
        (status.late, every(SWAPPED, 7)),
        (status.duplicate, every(TWICE, 11)),
    ] {
        assert!(found.abs_diff(expected) <= slack, "{status:?}");
    }
}

fn table(hours: f64, samples: u32, status: &Status, parts: &[Quality]) -> String {
    let Status {
        used,
        missing,
        late,
        duplicate,
        ..
    } = status;
    let mut text = format!(
        "{hours} h, {samples} samples: {used} used, {missing} missing, {late} late, none rejected or dropped, which adds \
         up; {duplicate} arrived twice.\n\n| hours | {}\n|---|{}\n",
        Quality::HEAD,
        Quality::RULE
    );
    for (part, quality) in (0u32..).zip(parts) {
        let [from, to] = [part, part + 1].map(|k| hours * f64::from(k) / f64::from(PARTS));
        text += &format!("| {from:.3} to {to:.3} | {quality}\n");
    }
    text
}
