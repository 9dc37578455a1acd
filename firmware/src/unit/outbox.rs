//! Frames waiting for transmission.

use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::link::{Header, LIMBS, LogPiece, MAX_FRAME_LENGTH, Message, PIECE_LENGTH};

use crate::limbs;
use crate::queue::Queue;

/// Length of the longest answer: a stored configuration with its rows and its state.
const ANSWER: usize = 2 + SEGMENT_COUNT + if limbs::IS_BUILT_IN { LIMBS } else { 0 };

/// Capacity of the queue: that, and what else is said meanwhile. When it is full the oldest frame is dropped, so a host that
/// does not read never blocks the unit.
const FRAMES: usize = ANSWER + 6;

/// Number of message type codes.
const TYPES: usize = 0x19;

#[derive(Debug)]
pub(super) struct Outbox {
    frames: Queue<(Header, Message), FRAMES>,
    /// Next sequence number of each message type.
    sequences: [u32; TYPES],
    failed: u32,
}

impl Outbox {
    pub(super) const fn new() -> Self {
        Self {
            frames: Queue::new(),
            sequences: [0; TYPES],
            failed: 0,
        }
    }

    /// Restarts the sequence numbers; queued frames are still sent.
    pub(super) fn begin_session(&mut self) {
        self.sequences = [0; TYPES];
    }

    pub(super) fn push(&mut self, session: u16, time: u64, message: Message) {
        let mut sequence = 0;
        if let Some(next) = self.sequences.get_mut(usize::from(message.code())) {
            sequence = *next;
            *next = next.wrapping_add(1);
        }
        let header = Header {
            session,
            sequence,
            time,
        };
        self.frames.push((header, message));
    }

    /// Takes the oldest frame; a clock comparison is stamped with the time `now` (us).
    pub(super) fn next(&mut self, now: u64, frame: &mut [u8; MAX_FRAME_LENGTH]) -> Option<usize> {
        let (header, mut message) = self.frames.pop()?;
        if let Message::TimeSync(answer) = &mut message {
            answer.answered = now;
        }
        message.encode(&header, frame).ok()
    }

    pub(super) fn count_dropped(&mut self) {
        self.failed = self.failed.wrapping_add(1);
    }

    /// Number of frames that were not sent completely.
    pub(super) fn dropped(&self) -> u32 {
        self.frames.dropped().wrapping_add(self.failed)
    }
}

/// Splits a block of the log into link messages; a single empty piece if there is no block of this number.
pub(super) fn pieces(block: u32, bytes: &[u8]) -> impl Iterator<Item = LogPiece> {
    let length = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
    let count = bytes.len().div_ceil(PIECE_LENGTH).max(1);
    (0..length.max(1))
        .step_by(PIECE_LENGTH)
        .take(count)
        .map(move |offset| {
            let mut piece = LogPiece {
                block,
                length,
                offset,
                bytes: [0; PIECE_LENGTH],
            };
            let rest = bytes.get(usize::from(offset)..).unwrap_or_default();
            for (place, byte) in piece.bytes.iter_mut().zip(rest) {
                *place = *byte;
            }
            piece
        })
}
