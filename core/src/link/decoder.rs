//! Decodes bytes to messages with a state machine that always resynchronises and counts what it rejects.

use cobs::{DecodeResult, DecoderState};

use super::decode_error::DecodeError;
use super::frame::{self, Header, MAX_PACKET_LENGTH};
use super::message::Message;

/// What a received byte completed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Event {
    /// A valid message.
    Frame(Header, Message),
    /// Something that began as a frame but is invalid.
    Refused(DecodeError),
}

/// Counters of a decoder since its creation. All of them wrap.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counters {
    /// Bytes received.
    pub bytes: u32,
    /// Valid frames.
    pub frames: u32,
    /// Frames whose checksum does not match.
    pub crc_bad: u32,
    /// Frames that are not valid COBS or shorter than a header.
    pub cobs_bad: u32,
    /// Frames longer than any message.
    pub too_long: u32,
    /// Undamaged frames of another protocol version.
    pub wrong_version: u32,
    /// Undamaged frames of an unknown type.
    pub unknown_type: u32,
    /// Undamaged frames whose body length does not match their type.
    pub wrong_length: u32,
    /// Undamaged frames with a number that is not finite.
    pub not_finite: u32,
    /// Undamaged frames with a value out of range.
    pub out_of_range: u32,
}

impl Counters {
    /// Number of frames damaged in transit, whose sequence numbers are unknown.
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

/// Decodes bytes, supplied in pieces of any size, to messages.
///
/// Whatever the input, the decoder resynchronises at the next delimiter: a frame that arrives with both delimiters is
/// judged on its own bytes alone.
#[derive(Debug)]
pub struct Decoder {
    packet: [u8; MAX_PACKET_LENGTH],
    length: usize,
    stuffing: DecoderState,
    /// Whether the present frame is too long; its bytes are ignored up to the next delimiter.
    skipping: bool,
    counters: Counters,
}

impl Default for Decoder {
    fn default() -> Self {
        Self::new()
    }
}

impl Decoder {
    /// Creates a decoder that waits for its first frame.
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

    /// Returns the counters.
    pub const fn counters(&self) -> &Counters {
        &self.counters
    }

    /// Discards a partial frame, for example after a receiver error; the counters are kept.
    pub fn discard_partial(&mut self) {
        self.stuffing = DecoderState::Idle;
        self.length = 0;
        // Only a delimiter marks the start of the next frame.
        self.skipping = true;
    }

    /// Processes one byte; returns an event if it completed a frame.
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
    /// Decodes one whole frame, with or without its delimiters.
    ///
    /// # Errors
    /// Returns an error if the frame is rejected; [`DecodeError::Incomplete`] means that there is no frame.
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
