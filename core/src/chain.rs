//! The line on which sensors on the limbs send their readings to the unit: one pair of wires for all of them (RS-485), 1
//! Mbit/s, one packet from each node in each cycle.
//!
//! The node on the pelvis keeps the time. Its packet begins a cycle, and every other node that hears it sends its own in
//! the slot of its address, so that nobody talks at the same time and the unit need not talk at all. The address is the
//! number of the segment. `docs/link.md` lists every byte.
//!
//! | | bytes | time at 1 Mbit/s, ten bits a byte |
//! |---|---|---|
//! | packet | 25 | 0.25 ms |
//! | slot | | 0.3 ms |
//! | sixteen slots | | 4.8 ms of 10 ms at 100 Hz, of 5 ms at 200 Hz |
//! | a receiver's `NAV-PVT` after the slots | 100 | 1 ms, at 100 Hz |
//!
//! ```
//! use bodyflight_core::Segment;
//! use bodyflight_core::chain::{Decoder, PACKET_LENGTH, Packet};
//!
//! let packet = Packet { segment: Segment::Pelvis, cycle: 7, time: 70_000, age: 12, rates: [800, 0, -8], forces: [0, 0, 981] };
//! let bytes: [u8; PACKET_LENGTH] = packet.encode();
//! let mut decoder = Decoder::new();
//! assert_eq!(decoder.next(&mut &bytes[..]), Some(packet));
//! assert!((packet.reading().specific_force.z - 9.81).abs() < 1e-5);
//! ```

pub mod cycle;

use nalgebra::Vector3;

use crate::body::Segment;
use crate::link::checksum;
use crate::math::Lanes;
use crate::suit::strapdown::Reading;

/// Rate of the line (baud).
pub const BAUD: u32 = 1_000_000;
/// Time from the begin of the pelvis's packet to that of the node with address 1, and from each node to the next (us).
pub const SLOT: u32 = 300;
/// Length of a packet (bytes).
pub const PACKET_LENGTH: usize = 25;
/// Time that a packet takes on the line (us): ten bits a byte.
#[expect(clippy::cast_possible_truncation, reason = "250")]
pub const PACKET_TIME: u32 = PACKET_LENGTH as u32 * 10_000_000 / BAUD;
/// First byte of a packet.
pub const SYNC: u8 = 0xd2;
/// Upper half of the second byte: version of the format. The lower half is the address.
pub const VERSION: u8 = 1;
/// Age of a measurement at the begin of the cycle that says that it is older, or that there is none (0.1 ms).
pub const TOO_OLD: u8 = u8::MAX;

/// Counts of a rad/s: up to 2347 deg/s.
const RATE_COUNTS: f32 = 800.0;
/// Counts of a m/s2: up to 33 g.
const FORCE_COUNTS: f32 = 100.0;

/// One reading of one node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Packet {
    /// The segment that carries the node, its address.
    pub segment: Segment,
    /// Number of the cycle, as the pelvis's node counts; wraps.
    pub cycle: u16,
    /// Begin of the cycle by the clock of the pelvis's node (us), wraps.
    pub time: u32,
    /// Age of the measurement at the begin of the cycle (0.1 ms); [`TOO_OLD`] if there is none.
    pub age: u8,
    /// Angular velocity (1/800 rad/s), sensor axes. What rounding leaves over is carried to the next packet.
    pub rates: [i16; 3],
    /// Specific force (1/100 m/s2), sensor axes.
    pub forces: [i16; 3],
}

impl Packet {
    /// The packet's bytes.
    pub fn encode(&self) -> [u8; PACKET_LENGTH] {
        let mut bytes = [0; PACKET_LENGTH];
        let (content, sum) = bytes.split_at_mut(PACKET_LENGTH - 4);
        let [c0, c1] = self.cycle.to_le_bytes();
        let head = [SYNC, VERSION << 4 | self.segment as u8, c0, c1];
        let counts = self.rates.iter().chain(&self.forces);
        let rest = head
            .into_iter()
            .chain(self.time.to_le_bytes())
            .chain([self.age])
            .chain(counts.flat_map(|count| count.to_le_bytes()));
        for (place, byte) in content.iter_mut().zip(rest) {
            *place = byte;
        }
        let found = checksum([&*content]);
        for (place, byte) in sum.iter_mut().zip(found.to_le_bytes()) {
            *place = byte;
        }
        bytes
    }

    /// Reads a whole packet; `None` if it is damaged or of another version.
    fn decode(bytes: &[u8; PACKET_LENGTH]) -> Option<Self> {
        let (content, sum) = bytes.split_last_chunk::<4>()?;
        if checksum([content]) != u32::from_le_bytes(*sum) {
            return None;
        }
        let (head, rest) = content.split_first_chunk::<9>()?;
        let [_, address, c0, c1, t0, t1, t2, t3, age] = *head;
        let (words, _) = rest.as_chunks::<2>();
        let mut counts = [0; 6];
        for (count, word) in counts.iter_mut().zip(words) {
            *count = i16::from_le_bytes(*word);
        }
        let [rx, ry, rz, fx, fy, fz] = counts;
        Some(Self {
            segment: *Segment::ALL.get(usize::from(address & 0x0f))?,
            cycle: u16::from_le_bytes([c0, c1]),
            time: u32::from_le_bytes([t0, t1, t2, t3]),
            age,
            rates: [rx, ry, rz],
            forces: [fx, fy, fz],
        })
    }

    /// The reading in SI units.
    pub fn reading(&self) -> Reading<f32> {
        Reading {
            angular_velocity: Vector3::from(self.rates.map(f32::from)) / RATE_COUNTS,
            specific_force: Vector3::from(self.forces.map(f32::from)) / FORCE_COUNTS,
        }
    }
}

/// Converts readings to counts. Rounding loses nothing over time: what it leaves over goes into the next reading, so the
/// integral of the rates is exact to one count.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Rounding {
    left: Vector3<f32>,
}

impl Rounding {
    /// Rates and forces of a reading as counts; beyond the range the largest count. Numbers that are not finite count as
    /// zero.
    pub fn counts(&mut self, reading: &Reading<f32>) -> [[i16; 3]; 2] {
        let wanted = reading.angular_velocity * RATE_COUNTS + self.left;
        let rates = wanted.map(whole);
        let left = wanted - rates.map(f32::from);
        // Beyond the range nothing is carried.
        self.left = left.map(|left| if left.abs() <= 0.5 { left } else { 0.0 });
        let forces = (reading.specific_force * FORCE_COUNTS).map(whole);
        [rates.into(), forces.into()]
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "saturates, and zero for a number that is none"
)]
fn whole(value: f32) -> i16 {
    value.nearest() as i16
}

/// Counters of a line; all wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes received.
    pub bytes: u32,
    /// Whole packets.
    pub packets: u32,
    /// Bytes outside of packets: noise, damaged packets, or the messages of a receiver.
    pub skipped: u32,
}

/// Finds packets in arbitrary bytes: after a wrong checksum the search resumes one byte later.
#[derive(Debug, Clone)]
pub struct Decoder {
    bytes: [u8; PACKET_LENGTH],
    length: usize,
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Creates a decoder.
    pub const fn new() -> Self {
        Self {
            bytes: [0; PACKET_LENGTH],
            length: 0,
            counters: Counters {
                bytes: 0,
                packets: 0,
                skipped: 0,
            },
        }
    }

    /// The counters: every byte is in a packet, skipped, or one of up to 24 that may yet be the start of a packet.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Returns the next packet and advances `input` past the bytes used.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<Packet> {
        while let Some((byte, rest)) = input.split_first() {
            *input = rest;
            self.counters.bytes = self.counters.bytes.wrapping_add(1);
            if let Some(place) = self.bytes.get_mut(self.length) {
                *place = *byte;
                self.length += 1;
            }
            if let Some(packet) = self.settle() {
                self.counters.packets = self.counters.packets.wrapping_add(1);
                return Some(packet);
            }
        }
        None
    }

    /// Drops bytes from the front until what is left may be the start of a packet, or returns the packet.
    fn settle(&mut self) -> Option<Packet> {
        while self.length > 0 {
            let [first, second, ..] = self.bytes;
            let starts = first == SYNC && (self.length < 2 || second >> 4 == VERSION);
            if starts && self.length < PACKET_LENGTH {
                return None;
            }
            if starts && let Some(packet) = Packet::decode(&self.bytes) {
                self.length = 0;
                return Some(packet);
            }
            self.bytes.copy_within(1.., 0);
            self.length -= 1;
            self.counters.skipped = self.counters.skipped.wrapping_add(1);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use proptest::prelude::*;
    use std::vec::Vec;

    use super::*;

    fn packet() -> impl Strategy<Value = Packet> {
        (
            0..16_usize,
            any::<(u16, u32, u8)>(),
            any::<[i16; 3]>(),
            any::<[i16; 3]>(),
        )
            .prop_map(|(address, (cycle, time, age), rates, forces)| Packet {
                segment: Segment::ALL[address],
                cycle,
                time,
                age,
                rates,
                forces,
            })
    }

    proptest! {
        #[test]
        fn packets_are_found_in_noise_and_every_byte_is_counted(
            parts in prop::collection::vec(
                (packet(), prop::collection::vec(prop_oneof![Just(SYNC), any::<u8>()], 0..30)), 1..12),
            piece in 1_usize..60,
        ) {
            let mut line = Vec::new();
            for (packet, noise) in &parts {
                line.extend(noise);
                line.extend(packet.encode());
            }
            let mut decoder = Decoder::new();
            let mut found = Vec::new();
            for mut bytes in line.chunks(piece) {
                while let Some(packet) = decoder.next(&mut bytes) {
                    found.push(packet);
                }
            }
            let sent: Vec<_> = parts.iter().map(|(packet, _)| *packet).collect();
            prop_assert_eq!(&found, &sent);
            let counters = decoder.counters();
            prop_assert_eq!(counters.packets as usize, sent.len());
            let counted = counters.skipped as usize + found.len() * PACKET_LENGTH + decoder.length;
            prop_assert_eq!(counted, line.len());
        }

        #[test]
        fn a_damaged_packet_is_none_and_the_next_is_found(
            packets in [packet(), packet()], place in 0..PACKET_LENGTH, change in 1_u8..,
        ) {
            let [first, second] = packets;
            let mut line: Vec<_> = [first, second].iter().flat_map(Packet::encode).collect();
            line[place] ^= change;
            let mut decoder = Decoder::new();
            let mut input = &line[..];
            prop_assert_eq!(decoder.next(&mut input), Some(second));
            prop_assert_eq!(decoder.counters().skipped as usize, PACKET_LENGTH);
        }

        #[test]
        fn rounding_loses_no_turn(rates in prop::collection::vec(-40.0_f32..40.0, 1..300)) {
            let mut rounding = Rounding::default();
            let (mut sent, mut turned) = (0.0_f64, 0.0_f64);
            for rate in rates {
                let reading = Reading {
                    angular_velocity: Vector3::new(rate, 0.0, f32::NAN),
                    specific_force: Vector3::new(1e9, -1e9, 0.004),
                };
                let [[count, _, none], forces] = rounding.counts(&reading);
                prop_assert_eq!((none, forces), (0, [i16::MAX, i16::MIN, 0]));
                sent += f64::from(count) / f64::from(RATE_COUNTS);
                turned += f64::from(rate);
            }
            prop_assert!((sent - turned).abs() < 1.0 / f64::from(RATE_COUNTS), "{sent} {turned}");
        }
    }
}
