//! Blocks of a log: packets of the link, each stored as its difference from the previous packet of the same type.
//!
//! A block is self-contained: its packets can be read whatever happens to other blocks, and each includes its
//! checksum, combined with its number in the block. A packet is stored as its type followed by the exclusive or with
//! the previous packet of that type in the block (for samples, sensors and estimates; the first is combined with
//! zeros), with runs of zeros shortened: a byte `0x80 + n` stands for `n + 1` zeros, and a byte `n` below `0x80`
//! precedes `n + 1` literal bytes.
//!
//! The number is needed because a cyclic checksum is linear: where damage removes or repeats a difference, the packets
//! after it would be sums of an odd number of good packets, whose checksums are right.

use super::decode_error::DecodeError;
use super::frame::{self, Header, MAX_PACKET_LENGTH};
use super::message::Message;

/// Maximum length of a block (bytes): four blocks, with what the storage adds, fit a sector of 4 KiB.
pub const BLOCK_LENGTH: usize = 1008;

/// Longest run that one byte can describe.
const LONGEST_RUN: usize = 0x80;

/// The packets so far.
#[derive(Debug, Clone)]
struct Before {
    /// The last packet of each recurring type, as stored.
    last: [[u8; MAX_PACKET_LENGTH]; 3],
    /// Number of packets.
    count: u32,
}

impl Before {
    const fn new() -> Self {
        Self {
            last: [[0; MAX_PACKET_LENGTH]; 3],
            count: 0,
        }
    }

    /// Combines the checksum at the end of the next packet with its number; the second time, takes it out again.
    fn number(&self, packet: &mut [u8]) {
        let mixed = self.count.wrapping_add(1).wrapping_mul(0x9E37_79B9);
        let mixed = (mixed ^ (mixed >> 15)).wrapping_mul(0x85EB_CA6B);
        if let Some(sum) = packet.last_chunk_mut::<4>() {
            *sum = (u32::from_le_bytes(*sum) ^ mixed).to_le_bytes();
        }
    }

    fn of(&mut self, code: u8) -> Option<&mut [u8; MAX_PACKET_LENGTH]> {
        let [samples, estimates, sensors] = &mut self.last;
        match code {
            0x10 => Some(samples),
            0x11 => Some(estimates),
            0x14 => Some(sensors),
            _ => None,
        }
    }
}

/// A block under construction.
#[derive(Debug, Clone)]
pub struct BlockWriter {
    bytes: [u8; BLOCK_LENGTH],
    length: usize,
    before: Before,
}

impl Default for BlockWriter {
    fn default() -> Self {
        Self::new()
    }
}

impl BlockWriter {
    /// Creates an empty block.
    pub const fn new() -> Self {
        Self {
            bytes: [0; BLOCK_LENGTH],
            length: 0,
            before: Before::new(),
        }
    }

    /// Returns the bytes written so far.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// Returns whether the block is empty.
    pub const fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Starts the next block.
    pub fn clear(&mut self) {
        self.length = 0;
        self.before = Before::new();
    }

    /// Adds a message. Returns `false` if it does not fit; the block is then unchanged.
    pub fn push(&mut self, header: &Header, message: &Message) -> bool {
        let mut packet = [0; MAX_PACKET_LENGTH];
        let Some(length) = frame::write_packet(header, message, &mut packet) else {
            return false;
        };
        let code = message.code();
        let whole = packet.get_mut(..length).unwrap_or_default();
        self.before.number(whole);
        let mut change = packet;
        if let Some(before) = self.before.of(code) {
            exclusive_or(&mut change, before);
        }
        let room = self.bytes.get_mut(self.length..).unwrap_or_default();
        let change = change.get(..length).unwrap_or_default();
        let Some(taken) = shorten(code, change, room) else {
            return false;
        };
        self.length += taken;
        self.before.count = self.before.count.wrapping_add(1);
        if let Some(before) = self.before.of(code) {
            *before = packet;
        }
        true
    }
}

fn exclusive_or(packet: &mut [u8; MAX_PACKET_LENGTH], before: &[u8; MAX_PACKET_LENGTH]) {
    for (byte, before) in packet.iter_mut().zip(before) {
        *byte ^= before;
    }
}

/// Writes the type and the runs; returns the number of bytes written, or `None` if they do not fit.
fn shorten(code: u8, mut change: &[u8], room: &mut [u8]) -> Option<usize> {
    let mut output = room.iter_mut();
    let before = output.len();
    *output.next()? = code;
    while !change.is_empty() {
        let zeros = change
            .iter()
            .take(LONGEST_RUN)
            .take_while(|byte| **byte == 0);
        let zeros = zeros.count();
        // A single zero between other bytes is not worth a run of its own.
        if zeros > 1 || zeros == change.len() {
            *output.next()? = run_code(zeros) | 0x80;
            change = change.get(zeros..)?;
            continue;
        }
        let two_zeros = change.windows(2).position(|pair| pair == [0, 0]);
        let length = two_zeros.unwrap_or(change.len()).clamp(1, LONGEST_RUN);
        let (plain, rest) = change.split_at_checked(length)?;
        *output.next()? = run_code(length);
        for byte in plain {
            *output.next()? = *byte;
        }
        change = rest;
    }
    Some(before - output.len())
}

/// Encodes a length of 1 to [`LONGEST_RUN`] in seven bits.
fn run_code(length: usize) -> u8 {
    u8::try_from(length - 1).unwrap_or_default()
}

/// Reads a block from arbitrary bytes: yields messages until the block ends, or one error where it is damaged.
#[derive(Debug, Clone)]
pub struct BlockReader<'a> {
    rest: &'a [u8],
    before: Before,
}

impl<'a> BlockReader<'a> {
    /// Starts at the first packet.
    pub const fn new(block: &'a [u8]) -> Self {
        Self {
            rest: block,
            before: Before::new(),
        }
    }

    fn packet(&mut self) -> Result<(Header, Message), DecodeError> {
        let (code, mut rest) = self.rest.split_first().ok_or(DecodeError::TooShort)?;
        let length = frame::packet_length(*code).ok_or(DecodeError::UnknownType { code: *code })?;
        let mut packet = [0; MAX_PACKET_LENGTH];
        let mut places = packet.iter_mut().take(length);
        while places.len() > 0 {
            let (run, tail) = rest.split_first().ok_or(DecodeError::TooShort)?;
            let count = usize::from(run & 0x7f) + 1;
            if count > places.len() {
                return Err(DecodeError::TooLong);
            }
            rest = tail;
            if run & 0x80 != 0 {
                places.nth(count - 1);
                continue;
            }
            let (plain, tail) = rest.split_at_checked(count).ok_or(DecodeError::TooShort)?;
            // The order matters: the other way round, `zip` would consume one place too many.
            for (byte, place) in plain.iter().zip(places.by_ref()) {
                *place = *byte;
            }
            rest = tail;
        }
        if let Some(before) = self.before.of(*code) {
            exclusive_or(&mut packet, before);
            *before = packet;
        }
        self.rest = rest;
        let packet = packet.get_mut(..length).unwrap_or_default();
        self.before.number(packet);
        self.before.count = self.before.count.wrapping_add(1);
        frame::open(packet)
    }
}

impl Iterator for BlockReader<'_> {
    type Item = Result<(Header, Message), DecodeError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.rest.is_empty() {
            return None;
        }
        let packet = self.packet();
        if packet.is_err() {
            // Nothing after a damaged packet can be decoded.
            self.rest = &[];
        }
        Some(packet)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use proptest::prelude::*;

    use super::*;
    use crate::Posture;
    use crate::frame::{Rotation, Vector};
    use crate::link::{Motion, Sample, Stop};
    use crate::math::small_rotation;
    use nalgebra::Vector3;

    /// A sample of a skydiver who turns in a fixed posture.
    fn sample(number: u32) -> (Header, Message) {
        let time = f32::from(u16::try_from(number).unwrap()) / 240.0;
        let attitude = Rotation::from_quaternion(small_rotation(&Vector3::new(
            0.1,
            0.3 * time,
            0.02 * time * time,
        )));
        let motion = Motion {
            angular_velocity: Some(Vector::new(0.1, time, 0.2)),
            velocity: Some(Vector::new(3.0 - time, 1.0, -50.0 - time)),
            horizontal_speed: None,
        };
        let header = Header {
            session: 7,
            sequence: number,
            time: 1_000_000 + u64::from(number) * 4167,
        };
        let sample = Sample::new(&Posture::h_pose(), &attitude, &motion);
        (header, sample.into())
    }

    #[test]
    fn samples_in_one_posture_take_a_third_of_a_frame() {
        let mut block = BlockWriter::new();
        let mut samples = (0..).map(sample);
        let written: Vec<_> = samples
            .by_ref()
            .take_while(|(header, message)| block.push(header, message))
            .collect();
        assert!(written.len() >= BLOCK_LENGTH / 45, "{}", written.len());
        let read: Result<Vec<_>, _> = BlockReader::new(block.bytes()).collect();
        assert_eq!(read.unwrap(), written);
    }

    #[test]
    fn a_message_without_room_leaves_the_block_as_it_was() {
        let mut block = BlockWriter::new();
        let mut number = 0;
        while block.push(&sample(number).0, &sample(number).1) {
            number += 1;
        }
        let full = block.bytes().to_vec();
        // Shorter messages may still fit.
        let stop = Message::from(Stop { sent: number });
        let header = Header::default();
        let had_room = block.push(&header, &stop);
        let read: Vec<_> = BlockReader::new(block.bytes())
            .map(Result::unwrap)
            .collect();
        assert_eq!(read.len(), number as usize + usize::from(had_room));
        assert_eq!(block.bytes()[..full.len()], full);
        block.clear();
        assert!(block.is_empty() && block.push(&header, &stop));
    }

    /// Checksums alone would accept all of these: a removed, a repeated, a moved and an empty difference.
    #[test]
    fn differences_in_another_order_yield_no_wrong_message() {
        let mut block = BlockWriter::new();
        let mut ends = Vec::from([0]);
        for number in 0..8 {
            assert!(block.push(&sample(number).0, &sample(number).1));
            ends.push(block.bytes().len());
        }
        let parts: Vec<&[u8]> = ends
            .windows(2)
            .map(|pair| &block.bytes()[pair[0]..pair[1]])
            .collect();
        let length = frame::packet_length(0x10).unwrap();
        let mut nothing = [0; 8];
        let taken = shorten(0x10, &[0; MAX_PACKET_LENGTH][..length], &mut nothing).unwrap();
        for place in 1..7 {
            let [before, after] = [&parts[..place], &parts[place + 1..]];
            let rest = [parts[place], &nothing[..taken]];
            for change in [
                [before, after].concat(),
                [before, &[parts[place]; 2], after].concat(),
                [before, &after[..1], &rest[..1], &after[1..]].concat(),
                [before, &rest[1..], after].concat(),
            ] {
                for (number, read) in BlockReader::new(&change.concat()).enumerate() {
                    if let Ok(read) = read {
                        assert_eq!(read, sample(u32::try_from(number).unwrap()), "{place}");
                    }
                }
            }
        }
    }

    proptest! {
        #[test]
        fn reading_ends_for_any_bytes(bytes in prop::collection::vec(any::<u8>(), 0..1100)) {
            let errors = BlockReader::new(&bytes).filter(Result::is_err).count();
            prop_assert!(errors <= 1);
        }

        #[test]
        fn a_damaged_block_yields_no_wrong_message(
            place in 0_usize..1000,
            hit in 1_u8..,
        ) {
            let mut block = BlockWriter::new();
            let mut number = 0;
            while block.push(&sample(number).0, &sample(number).1) {
                number += 1;
            }
            let mut bytes = block.bytes().to_vec();
            let place = place % bytes.len();
            bytes[place] ^= hit;
            for (number, read) in BlockReader::new(&bytes).enumerate() {
                if let Ok(read) = read {
                    prop_assert_eq!(read, sample(u32::try_from(number).unwrap()));
                }
            }
        }
    }
}
