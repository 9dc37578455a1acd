//! Decodes bytes to packets.

use super::packet::{Candidate, MAX_PACKET_LENGTH, MessageId, PREAMBLE, Packet, judge, view};

/// Counters of a decoder since its creation. All of them wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Packets decoded.
    pub packets: u32,
    /// Bytes that are not part of any packet.
    pub skipped_bytes: u32,
    /// Candidate packets with a wrong checksum.
    pub bad_checksum: u32,
    /// Candidate packets whose length is impossible or exceeds the buffer.
    pub bad_length: u32,
    /// MTData2 packets whose items do not fill them exactly.
    pub bad_items: u32,
}

/// Decodes bytes, supplied in pieces of any size, to packets.
///
/// After a false packet the search resumes **one byte** after the false preamble, in the bytes already stored, so that
/// a damaged packet never takes the following ones with it. `N` is the longest packet accepted (bytes):
/// [`MAX_PACKET_LENGTH`](super::MAX_PACKET_LENGTH) for all packets, 512 for any MTData2 of one sensor, at least 16.
#[derive(Debug)]
pub struct Decoder<const N: usize> {
    buffer: [u8; N],
    /// Bytes in `start..end` have not been examined yet.
    start: usize,
    end: usize,
    /// Length of the packet returned last; its bytes are released by the next call.
    given: usize,
    /// The only kind of message that is accepted.
    only: Option<MessageId>,
    counters: Counters,
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Decoder<N> {
    /// Creates a decoder that waits for its first packet.
    pub const fn new() -> Self {
        const { assert!(N >= 16 && N <= MAX_PACKET_LENGTH) };
        Self {
            buffer: [0; N],
            start: 0,
            end: 0,
            given: 0,
            only: None,
            counters: Counters {
                packets: 0,
                skipped_bytes: 0,
                bad_checksum: 0,
                bad_length: 0,
                bad_items: 0,
            },
        }
    }

    /// Accepts only messages of this kind. On a line that carries other protocols too, a preamble that occurs by chance
    /// then neither delays nor hides the packets around it: a receiver's small negative velocity, `FA FF FF FF`, did.
    #[must_use]
    pub const fn only(mut self, message: MessageId) -> Self {
        self.only = Some(message);
        self
    }

    /// Returns the counters.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Number of bytes stored of an incomplete packet.
    pub const fn pending(&self) -> usize {
        self.end
            .saturating_sub(self.start)
            .saturating_sub(self.given)
    }

    /// Returns the next packet and advances `input` past the bytes it used, or returns `None` once all input is used.
    ///
    /// Call this until it returns `None`, since one piece of input may complete several packets.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<Packet<'_>> {
        self.start += core::mem::take(&mut self.given);
        let total = loop {
            self.skip_to_preamble();
            if self.is_unwanted() {
                self.skip_one();
                continue;
            }
            match judge(self.buffer.get(self.start..self.end).unwrap_or_default()) {
                Candidate::Whole { total } => break total,
                Candidate::Incomplete { total } if total > N => {
                    count(&mut self.counters.bad_length);
                    self.skip_one();
                }
                Candidate::Incomplete { total } => {
                    if input.is_empty() {
                        return None;
                    }
                    self.fill(total, input);
                }
                Candidate::BadAddress => self.skip_one(),
                Candidate::BadChecksum => {
                    count(&mut self.counters.bad_checksum);
                    self.skip_one();
                }
                Candidate::BadLength => {
                    count(&mut self.counters.bad_length);
                    self.skip_one();
                }
                Candidate::BadItems => {
                    count(&mut self.counters.bad_items);
                    self.skip_one();
                }
            }
        };
        count(&mut self.counters.packets);
        self.given = total;
        view(self.buffer.get(self.start..self.end)?)
    }

    /// Abandons an incomplete packet, for example after a silence on the line or a receiver error.
    ///
    /// The bytes after its preamble are still searched: call [`Decoder::next`] with no input until it returns `None`,
    /// and repeat while [`Decoder::pending`] is not 0.
    pub fn give_up(&mut self) {
        self.start += core::mem::take(&mut self.given);
        if self.start < self.end {
            self.skip_one();
        }
    }

    /// Whether the bytes stored start a message of another kind than the one that is accepted.
    fn is_unwanted(&self) -> bool {
        let message = self.buffer.get(self.start + 2..self.end);
        let message = message.and_then(<[u8]>::first);
        (self.only.zip(message)).is_some_and(|(only, message)| only.0 != *message)
    }

    fn skip_one(&mut self) {
        self.start += 1;
        count(&mut self.counters.skipped_bytes);
    }

    fn skip_to_preamble(&mut self) {
        while let Some(&byte) = self
            .buffer
            .get(self.start..self.end)
            .and_then(<[u8]>::first)
        {
            if byte == PREAMBLE {
                return;
            }
            self.skip_one();
        }
    }

    /// Reads input until `total` bytes are stored from `start` on, or the input ends.
    fn fill(&mut self, total: usize, input: &mut &[u8]) {
        if self.start + total > N {
            let kept = self.end.saturating_sub(self.start);
            for at in 0..kept {
                let byte = self.buffer.get(self.start + at).copied();
                if let (Some(place), Some(byte)) = (self.buffer.get_mut(at), byte) {
                    *place = byte;
                }
            }
            self.start = 0;
            self.end = kept;
        }
        let wanted = (self.start + total).saturating_sub(self.end);
        let (taken, rest) = input.split_at(wanted.min(input.len()));
        if let Some(place) = self.buffer.get_mut(self.end..self.end + taken.len()) {
            place.copy_from_slice(taken);
            self.end += taken.len();
        }
        *input = rest;
    }
}

fn count(counter: &mut u32) {
    *counter = counter.wrapping_add(1);
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::super::{DataId, MessageId, PacketWriter};
    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    /// A measurement packet with `items` vectors and the counter value `number`.
    fn measurement(number: u16, items: usize) -> Vec<u8> {
        let mut packet = [0; MAX_PACKET_LENGTH];
        let mut writer = PacketWriter::new(&mut packet, MessageId::MT_DATA2);
        writer
            .item(DataId::PACKET_COUNTER, &number.to_be_bytes())
            .unwrap();
        for _ in 0..items {
            // The bytes of -125.0 and 3.1e35 contain preambles.
            writer
                .reals(DataId::ACCELERATION, &[f32::from(number), -125.0, 3.1e35])
                .unwrap();
        }
        let total = writer.finish().unwrap();
        packet[..total].to_vec()
    }

    /// Between packets a receiver sends words that start with a preamble, the address of a sensor and a length.
    #[test]
    fn a_decoder_for_one_kind_of_message_waits_for_no_other() {
        let word = (-6_i32).to_le_bytes();
        assert_eq!(word[..2], [PREAMBLE, 0xff]);
        let mut decoder = Decoder::<512>::new().only(MessageId::MT_DATA2);
        for number in 0..1000 {
            let bytes = [&word[..], &[0x20; 5], &measurement(number, 1)].concat();
            let mut input = &bytes[..];
            let packet = decoder.next(&mut input).expect("is there at once");
            assert_eq!(packet.data[3..5], number.to_be_bytes());
        }
    }

    /// Data of all packets in `bytes`, supplied in pieces of `piece` bytes; the remainder is abandoned.
    fn read<const N: usize>(bytes: &[u8], piece: usize) -> (Vec<Vec<u8>>, Counters) {
        let mut decoder = Decoder::<N>::new();
        let mut packets = Vec::new();
        for mut input in bytes.chunks(piece) {
            while let Some(packet) = decoder.next(&mut input) {
                packets.push(packet.data.to_vec());
            }
            assert!(input.is_empty());
        }
        while decoder.pending() > 0 {
            decoder.give_up();
            while let Some(packet) = decoder.next(&mut [].as_slice()) {
                packets.push(packet.data.to_vec());
            }
        }
        (packets, *decoder.counters())
    }

    fn data(packet: &[u8]) -> Vec<u8> {
        view(packet).unwrap().data.to_vec()
    }

    #[test]
    fn an_extended_packet_is_read_and_one_too_long_for_the_buffer_is_skipped() {
        let long = measurement(7, 30);
        assert!(long.len() > 400);
        let short = measurement(8, 1);
        let stream = [&long[..], &short].concat();
        assert_eq!(read::<512>(&stream, 5).0, [data(&long), data(&short)]);
        let (packets, counters) = read::<64>(&stream, 5);
        assert_eq!(packets, [data(&short)]);
        assert!(counters.bad_length > 0);
    }

    #[test]
    fn a_wrong_length_costs_no_other_packet() {
        let good: Vec<Vec<u8>> = (0..100).map(|n| measurement(n, 1)).collect();
        for lie in [
            [0x36, 0xFE, 0x00, 0x00],
            [0x36, 0xFF, 0x08, 0x00],
            [0x36, 0xFF, 0x08, 0x01],
        ] {
            let mut stream = std::vec![PREAMBLE, 0xFF];
            stream.extend(lie);
            stream.extend(good.concat());
            let (packets, _) = read::<MAX_PACKET_LENGTH>(&stream, 1);
            assert_eq!(packets.len(), 100, "{lie:?}");
            assert!(
                packets
                    .iter()
                    .zip(&good)
                    .all(|(found, sent)| *found == data(sent))
            );
        }
    }

    #[test]
    fn items_that_do_not_fill_a_packet_refuse_it() {
        let mut packet = [0; 64];
        let mut writer = PacketWriter::new(&mut packet, MessageId::MT_DATA2);
        writer.data(&[0x10, 0x20, 3, 0, 0]).unwrap();
        let total = writer.finish().unwrap();
        let (packets, counters) = read::<64>(&packet[..total], 64);
        assert!(packets.is_empty());
        assert_eq!((counters.bad_items, counters.packets), (1, 0));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(300))]

        #[test]
        fn pieces_of_any_size_give_the_same_and_every_byte_is_accounted_for(
            parts in prop::collection::vec((any::<bool>(), prop::collection::vec(any::<u8>(), 0..60)), 0..20),
            piece in 1usize..300,
        ) {
            let mut stream = Vec::new();
            for (number, (good, noise)) in (0u16..).zip(&parts) {
                stream.extend(noise);
                if *good {
                    stream.extend(measurement(number, 3));
                }
            }
            let whole = read::<512>(&stream, stream.len().max(1));
            prop_assert_eq!(&read::<512>(&stream, piece), &whole);
            prop_assert_eq!(&read::<512>(&stream, 1), &whole);
            let headers: usize = whole.0.iter().map(|data| data.len() + if data.len() < 255 { 5 } else { 7 }).sum();
            let skipped = usize::try_from(whole.1.skipped_bytes).unwrap();
            prop_assert_eq!(skipped + headers, stream.len());
        }

        #[test]
        fn any_changed_byte_costs_only_its_own_packet(
            at in 0usize..53,
            change in 1u8..=255,
        ) {
            let good: Vec<Vec<u8>> = (0..60).map(|n| measurement(n, 3)).collect();
            let mut stream = good.concat();
            let hit = good[0].len() * 10 + at.min(good[0].len() - 1);
            stream[hit] ^= change;
            let (packets, _) = read::<MAX_PACKET_LENGTH>(&stream, 64);
            let kept = good.iter().filter(|sent| packets.contains(&data(sent))).count();
            prop_assert!(kept >= 59, "{kept}");
        }
    }
}
