//! Bytes to messages: a state machine that never gets stuck and counts what it refuses.

use cobs::{DecodeResult, DecoderState};

use super::decode_error::DecodeError;
use super::frame::{self, Header, MAX_PACKET_LENGTH};
use super::message::Message;

/// What a byte completed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A good message.
    Frame(Header, Message),
    /// Something that began as a frame and is none.
    Refused(DecodeError),
}

/// What a decoder has seen since it was made. All counters wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes taken in.
    pub bytes: u32,
    /// Good frames.
    pub frames: u32,
    /// Frames whose checksum differs.
    pub crc_bad: u32,
    /// Frames that are no COBS, or shorter than a header.
    pub cobs_bad: u32,
    /// Frames longer than any message.
    pub too_long: u32,
    /// Whole frames of another protocol version.
    pub wrong_version: u32,
    /// Whole frames of a type that is not known.
    pub unknown_type: u32,
    /// Whole frames whose body has not the length of its type.
    pub wrong_length: u32,
    /// Whole frames with a number that is not finite.
    pub not_finite: u32,
    /// Whole frames with a value out of range.
    pub out_of_range: u32,
}

impl Counters {
    /// Frames damaged on the way: their sequence numbers are not known.
    pub const fn damaged(&self) -> u32 {
        self.crc_bad
            .wrapping_add(self.cobs_bad)
            .wrapping_add(self.too_long)
    }

    fn count(&mut self, error: &DecodeError) {
        let counter = match error {
            DecodeError::Cobs | DecodeError::TooShort | DecodeError::Incomplete => {
                &mut self.cobs_bad
            }
            DecodeError::TooLong => &mut self.too_long,
            DecodeError::Checksum => &mut self.crc_bad,
            DecodeError::Version { .. } => &mut self.wrong_version,
            DecodeError::UnknownType { .. } => &mut self.unknown_type,
            DecodeError::Length { .. } => &mut self.wrong_length,
            DecodeError::NotFinite { .. } => &mut self.not_finite,
            DecodeError::OutOfRange { .. } => &mut self.out_of_range,
        };
        *counter = counter.wrapping_add(1);
    }
}

/// Takes bytes as they come, in pieces of any size, and gives messages.
///
/// Whatever the bytes are, the decoder resynchronises at the next delimiter: a frame whose two delimiters
/// arrive is judged on its own bytes alone.
#[derive(Debug)]
pub struct Decoder {
    packet: [u8; MAX_PACKET_LENGTH],
    length: usize,
    stuffing: DecoderState,
    /// The frame is too long: nothing counts until the next delimiter.
    skipping: bool,
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Ready for the first frame.
    pub const fn new() -> Self {
        Self {
            packet: [0; MAX_PACKET_LENGTH],
            length: 0,
            stuffing: DecoderState::Idle,
            skipping: false,
            counters: Counters {
                bytes: 0,
                frames: 0,
                crc_bad: 0,
                cobs_bad: 0,
                too_long: 0,
                wrong_version: 0,
                unknown_type: 0,
                wrong_length: 0,
                not_finite: 0,
                out_of_range: 0,
            },
        }
    }

    /// What was seen so far.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Discards a partial frame, as after a receiver error; the counters stay.
    pub fn discard_partial(&mut self) {
        self.stuffing = DecoderState::Idle;
        self.length = 0;
        // Only a delimiter marks where the next frame begins.
        self.skipping = true;
    }

    /// Takes one byte; an event when it completed a frame.
    pub fn push(&mut self, byte: u8) -> Option<Event> {
        self.counters.bytes = self.counters.bytes.wrapping_add(1);
        if self.skipping {
            self.skipping = byte != 0;
            return None;
        }
        match self.stuffing.feed(byte) {
            Ok(DecodeResult::NoData) => None,
            Ok(DecodeResult::DataStart) => {
                self.length = 0;
                None
            }
            Ok(DecodeResult::DataContinue(value)) => match self.packet.get_mut(self.length) {
                Some(place) => {
                    *place = value;
                    self.length += 1;
                    None
                }
                None => {
                    self.discard_partial();
                    Some(self.refuse(DecodeError::TooLong))
                }
            },
            Ok(DecodeResult::DataComplete) => {
                let packet = self.packet.get(..self.length).unwrap_or_default();
                Some(match frame::open(packet) {
                    Ok((header, message)) => {
                        self.counters.frames = self.counters.frames.wrapping_add(1);
                        Event::Frame(header, message)
                    }
                    Err(error) => self.refuse(error),
                })
            }
            Err(_) => Some(self.refuse(DecodeError::Cobs)),
        }
    }

    fn refuse(&mut self, error: DecodeError) -> Event {
        self.counters.count(&error);
        Event::Refused(error)
    }
}

impl Message {
    /// The message in one whole frame, delimiters included or not.
    ///
    /// # Errors
    /// Returns why the frame is refused; [`DecodeError::Incomplete`] if there is no frame.
    pub fn decode(frame: &[u8]) -> Result<(Header, Self), DecodeError> {
        let mut decoder = Decoder::new();
        frame
            .iter()
            .chain(&[0])
            .find_map(|&byte| decoder.push(byte))
            .map_or(Err(DecodeError::Incomplete), |event| match event {
                Event::Frame(header, message) => Ok((header, message)),
                Event::Refused(error) => Err(error),
            })
    }
}
