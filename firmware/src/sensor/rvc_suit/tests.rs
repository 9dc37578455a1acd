//! Sensors that tumble, with clocks of their own.

use std::vec::Vec;

use bodyflight_core::chain::Decoder as Packets;
use bodyflight_core::chain::cycle::{Cycle, Cycles};
use proptest::prelude::*;

use super::*;
use crate::sensor::rvc;

/// Attitude of a sensor that tumbles, at a time (us).
fn attitude(line: usize, time: u64) -> UnitQuaternion<f32> {
    let (time, line) = (time as f32 * 1e-6, line as f32);
    let turn = Vector3::new(4.0, 0.7 * line - 3.0, 2.0) * time;
    rotation_by(&Vector3::new(0.5 * line, 0.3, 0.0)) * rotation_by(&turn)
}

/// What the unit makes of sensors for two seconds; a sensor's clock is wrong by parts per million, its first packet
/// comes at a time (us), and one packet is damaged. The unit looks every millisecond, but not for `stall` (us).
fn cycles(ppm: i64, begins: &[u64], lost: u64, stall: u64) -> Vec<Cycle> {
    let mut suit = RvcSuit::new();
    let mut waiting: Vec<std::collections::VecDeque<u8>> = vec_of(begins.len());
    let mut counts = std::vec![0_u64; begins.len()];
    let (mut packets, mut sorted, mut found) = (Packets::new(), Cycles::new(), Vec::new());
    for now in (0..2_000_000).step_by(1000) {
        for (line, begin) in begins.iter().enumerate() {
            let period = (10_000 * (1_000_000 + ppm * (line as i64 % 3 - 1)) / 1_000_000) as u64;
            let due = begin + counts[line] * period;
            if due <= now {
                let [index, ..] = counts[line].to_le_bytes();
                let force = Vector3::new(0.0, 0.0, 9.81);
                let mut packet = rvc::packet(index, &attitude(line, due), &force);
                packet[7] ^= u8::from(counts[line] == lost);
                waiting[line].extend(packet);
                counts[line] += 1;
            }
        }
        if (1_000_000..1_000_000 + stall).contains(&now) {
            continue;
        }
        loop {
            for (line, bytes) in waiting.iter_mut().enumerate() {
                while suit.has_room(line)
                    && let Some(byte) = bytes.pop_front()
                {
                    suit.take(line, byte, now);
                }
            }
            let Some(packet) = suit.packet(now) else {
                break;
            };
            let packet = packets.next(&mut &packet[..]).unwrap();
            found.extend(sorted.push(&packet));
        }
    }
    found
}

fn vec_of<T: Default>(count: usize) -> Vec<T> {
    (0..count).map(|_| T::default()).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the clocks are, a damaged packet and a program that stands still for a sector of the flash lose no turn.
    #[test]
    fn the_turns_of_all_sensors_arrive(
        ppm in -8000_i64..8000, begins in prop::collection::vec(0_u64..30_000, LINES..=LINES), lost in 20_u64..150,
    ) {
        let found = cycles(ppm, &begins, lost, 45_000);
        prop_assert!(found.len() > 180, "{}", found.len());
        for line in 0..LINES {
            let segment = segment(line).unwrap();
            let mut turned: Option<UnitQuaternion<f32>> = None;
            let mut time = 0;
            for cycle in &found {
                let Some(reading) = &cycle.readings[segment] else {
                    prop_assert_eq!(turned, None, "{:?} is missing at {}", segment, cycle.time);
                    continue;
                };
                let step = rotation_by(&(reading.angular_velocity * 0.01));
                time = u64::from(cycle.time);
                turned = Some(turned.map_or(attitude(line, time), |turned| turned * step));
                prop_assert!((reading.specific_force.z - 9.81).abs() < 0.02);
            }
            // Times are those of arrival, a millisecond later at most, and clocks that are slow a little more.
            let off = turned.unwrap().angle_to(&attitude(line, time)).to_degrees();
            prop_assert!(off < 2.0, "{segment:?}: {off} degrees");
        }
    }
}

std::thread_local! {
    static NOW: std::cell::Cell<u64> = const { std::cell::Cell::new(0) };
}

/// Time passes while the port waits.
struct Passing;

impl DelayNs for Passing {
    async fn delay_ns(&mut self, ns: u32) {
        NOW.set(NOW.get() + u64::from(ns) / 1000);
    }
}

/// Two sensors that send from 0.1 s on, a packet at once.
#[derive(Default)]
struct Two {
    sent: [usize; 2],
}

impl Lines for Two {
    fn next(&mut self, line: usize) -> Option<u8> {
        let sent = self.sent.get_mut(line)?;
        let (index, place) = (*sent / 19, *sent % 19);
        let due = 100_000 + 10_000 * index as u64;
        (due <= NOW.get()).then(|| {
            *sent += 1;
            let [index, ..] = index.to_le_bytes();
            rvc::packet(index, &attitude(line, due), &Vector3::z())[place]
        })
    }
}

/// The line of another sensor, which never ends.
struct Other;

impl ErrorType for Other {
    type Error = core::convert::Infallible;
}

impl Read for Other {
    async fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Self::Error> {
        NOW.set(NOW.get() + 1000);
        bytes[0] = 7;
        Ok(1)
    }
}

#[test]
fn a_port_reads_another_line_until_a_sensor_of_the_suit_is_heard() {
    let mut port = Port::new(Two::default(), Other, Passing, || NOW.get());
    let (mut others, mut packets, mut decoder) = (0, 0, Packets::new());
    while NOW.get() < 1_000_000 {
        let mut bytes = [0; 7];
        let count = embassy_futures::block_on(port.read(&mut bytes)).unwrap();
        let mut read = &bytes[..count];
        if read == [7] && packets == 0 && NOW.get() < 101_000 {
            others += 1;
            continue;
        }
        while decoder.next(&mut read).is_some() {
            packets += 1;
        }
    }
    assert!((95..105).contains(&others), "{others}");
    // Two sensors in each cycle of 0.9 s, less the delay and the first cycle.
    assert!((165..=176).contains(&packets), "{packets}");
    assert_eq!(decoder.counters().skipped, 0);
}

#[test]
fn a_sensor_that_is_silent_or_restarts_is_missing_and_turns_nothing() {
    let mut line = Line::new();
    let force = Vector3::z();
    let send = |line: &mut Line, index: u8, time: u64, turn: f32| {
        let turned = rotation_by(&(Vector3::z() * turn));
        for byte in rvc::packet(index, &turned, &force) {
            line.take(byte, time);
        }
    };
    for index in 0..10 {
        send(&mut line, index, 10_000 * u64::from(index), 0.0);
    }
    assert_eq!(line.counts(70_000), None, "the first has none before");
    assert_eq!(line.counts(80_000).unwrap()[0], [0; 3]);
    // It starts again in a second, and counts and turns anew.
    for index in 0..10 {
        send(&mut line, index, 1_000_000 + 10_000 * u64::from(index), 2.0);
    }
    for instant in (90_000..=1_040_000).step_by(10_000) {
        assert_eq!(line.counts(instant), None, "{instant}");
    }
    assert_eq!(line.counts(1_050_000).unwrap()[0], [0; 3]);
}
