//! Bytes to packets.

use super::packet::{Candidate, MAX_PACKET_LENGTH, PREAMBLE, Packet, judge};

/// What a decoder has seen since it was made. All counters wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Packets given out.
    pub packets: u32,
    /// Bytes that belong to no packet.
    pub skipped_bytes: u32,
    /// Preambles whose packet had a wrong checksum.
    pub bad_checksum: u32,
    /// Preambles whose length cannot be or does not fit the buffer.
    pub bad_length: u32,
    /// MTData2 packets whose items do not fill them.
    pub bad_items: u32,
}

/// Takes bytes in pieces of any size and gives packets out.
///
/// After a packet that is none it goes on **one byte** behind the false preamble, with the bytes it has
/// kept, so a damaged packet never takes the packets after it along. `N` is the longest packet accepted:
/// [`MAX_PACKET_LENGTH`](super::MAX_PACKET_LENGTH) for all, 512 for any MTData2 of one sensor. At least 16.
#[derive(Debug)]
pub struct Decoder<const N: usize> {
    buffer: [u8; N],
    /// Bytes in `start..end` are not judged yet.
    start: usize,
    end: usize,
    /// Bytes of the packet given out last; they go with the next call.
    given: usize,
    counters: Counters,
}

impl<const N: usize> Default for Decoder<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Decoder<N> {
    /// Nothing received yet.
    pub const fn new() -> Self {
        const { assert!(N >= 16 && N <= MAX_PACKET_LENGTH) };
        Self {
            buffer: [0; N],
            start: 0,
            end: 0,
            given: 0,
            counters: Counters {
                packets: 0,
                skipped_bytes: 0,
                bad_checksum: 0,
                bad_length: 0,
                bad_items: 0,
            },
        }
    }

    /// What was seen so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Bytes of a packet that has begun.
    pub const fn pending(&self) -> usize {
        self.end
            .saturating_sub(self.start)
            .saturating_sub(self.given)
    }

    /// The next packet; `input` is shortened by what was taken. `None` when all of it is taken.
    ///
    /// Call it until it gives `None`: one piece of input may complete several packets.
    pub fn next(&mut self, input: &mut &[u8]) -> Option<Packet<'_>> {
        self.start += core::mem::take(&mut self.given);
        let total = loop {
            self.skip_to_preamble();
            match judge(self.buffer.get(self.start..self.end).unwrap_or_default()) {
                Candidate::Whole { total, .. } => break total,
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
        // Judged again because the loop above may still change the buffer in the eyes of the borrow checker.
        match judge(self.buffer.get(self.start..self.end)?) {
            Candidate::Whole { packet, .. } => Some(packet),
            _ => None,
        }
    }

    /// Gives up the packet that has begun, as after silence on the line or an error of the receiver.
    ///
    /// The bytes behind its preamble are still searched: call [`Decoder::next`] with no input until it gives
    /// `None`, and again while [`Decoder::pending`] is not 0.
    pub fn give_up(&mut self) {
        self.start += core::mem::take(&mut self.given);
        if self.start < self.end {
            self.skip_one();
        }
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

    /// Takes bytes in until `total` of them lie at `start`, or the input ends.
    fn fill(&mut self, total: usize, input: &mut &[u8]) {
        if self.start + total > N {
            self.buffer.copy_within(self.start..self.end, 0);
            self.end -= self.start;
            self.start = 0;
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
