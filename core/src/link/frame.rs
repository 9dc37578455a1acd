//! Encoding and decoding of a single frame: header, checksum and byte stuffing.

use core::fmt;

use crc::{CRC_32_ISCSI, Crc, Table};

use super::decode_error::DecodeError;
use super::layout::PROTOCOL_VERSION;
use super::message::{LAYOUTS, Message};
use super::wire::{Reader, Wire, Writer};

/// CRC-32C with a table of 1 KiB. It detects every error of up to 5 bits in a frame of this length.
static CHECKSUM: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

const HEADER_LENGTH: usize = 16;
const CHECKSUM_LENGTH: usize = 4;

/// Length of the longest packet before stuffing (bytes): header, body, checksum.
pub const MAX_PACKET_LENGTH: usize = HEADER_LENGTH + longest_body() + CHECKSUM_LENGTH;

/// Length of the longest frame on the wire (bytes), including both delimiters.
pub const MAX_FRAME_LENGTH: usize = cobs::max_encoding_length(MAX_PACKET_LENGTH) + 2;

// Up to 253 bytes, stuffing costs exactly one byte, so every message has a fixed length on the wire.
const _: () = assert!(MAX_PACKET_LENGTH < 254);

const fn longest_body() -> usize {
    let (mut longest, mut rest) = (0, LAYOUTS);
    while let [layout, tail @ ..] = rest {
        if layout.size > longest {
            longest = layout.size;
        }
        rest = tail;
    }
    longest
}

/// Data that every message carries besides its type and body.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Header {
    /// Session number chosen by the host.
    pub session: u16,
    /// Number of the frame among those of its type in the session, from 0; wraps.
    pub sequence: u32,
    /// Sensor time for a sample and its estimate, the sender's clock otherwise (us).
    pub time: u64,
}

/// Error for a buffer that is too short for the frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EncodeError;

impl fmt::Display for EncodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the buffer is too short for the frame; {MAX_FRAME_LENGTH} bytes always suffice"
        )
    }
}

impl core::error::Error for EncodeError {}

/// Computes the CRC-32C over several pieces.
pub(crate) fn checksum<'a>(pieces: impl IntoIterator<Item = &'a [u8]>) -> u32 {
    let mut digest = CHECKSUM.digest();
    for piece in pieces {
        digest.update(piece);
    }
    digest.finalize()
}

impl Message {
    /// Writes a whole frame with its delimiters to `frame` and returns its length (bytes).
    ///
    /// # Errors
    /// Returns an error if `frame` is too short. [`MAX_FRAME_LENGTH`] bytes are always enough.
    pub fn encode(&self, header: &Header, frame: &mut [u8]) -> Result<usize, EncodeError> {
        let mut packet = [0; MAX_PACKET_LENGTH];
        let length = write_packet(header, self, &mut packet).ok_or(EncodeError)?;
        let packet = packet.get(..length).ok_or(EncodeError)?;
        let (start, rest) = frame.split_first_mut().ok_or(EncodeError)?;
        let stuffed = cobs::try_encode(packet, rest).map_err(|_| EncodeError)?;
        *start = 0;
        *rest.get_mut(stuffed).ok_or(EncodeError)? = 0;
        Ok(stuffed + 2)
    }
}

/// Length of a packet of this type (bytes): header, body, checksum; `None` if there is no such type.
pub(super) fn packet_length(code: u8) -> Option<usize> {
    let layout = LAYOUTS.iter().find(|layout| layout.code == code)?;
    Some(HEADER_LENGTH + layout.size + CHECKSUM_LENGTH)
}

/// Writes a packet before stuffing and returns its length (bytes), or `None` if it does not fit.
pub(super) fn write_packet(header: &Header, message: &Message, packet: &mut [u8]) -> Option<usize> {
    let mut writer = Writer::new(packet);
    PROTOCOL_VERSION.put(&mut writer)?;
    message.code().put(&mut writer)?;
    header.session.put(&mut writer)?;
    header.sequence.put(&mut writer)?;
    header.time.put(&mut writer)?;
    message.put(&mut writer)?;
    let covered = writer.written();
    let sum = checksum([packet.get(..covered)?]);
    let place = packet.get_mut(covered..covered + CHECKSUM_LENGTH)?;
    place.copy_from_slice(&sum.to_le_bytes());
    Some(covered + CHECKSUM_LENGTH)
}

/// Decodes an unstuffed packet, checking first the checksum and then version, type, length and values.
pub(super) fn open(packet: &[u8]) -> Result<(Header, Message), DecodeError> {
    let (covered, sum) = packet
        .split_last_chunk::<CHECKSUM_LENGTH>()
        .ok_or(DecodeError::TooShort)?;
    let (start, body) = covered
        .split_first_chunk::<HEADER_LENGTH>()
        .ok_or(DecodeError::TooShort)?;
    if checksum([covered]) != u32::from_le_bytes(*sum) {
        return Err(DecodeError::Checksum);
    }
    let mut reader = Reader::new(start);
    let [version, code] = reader.take();
    let header = Header {
        session: u16::from_le_bytes(reader.take()),
        sequence: u32::from_le_bytes(reader.take()),
        time: u64::from_le_bytes(reader.take()),
    };
    if version != PROTOCOL_VERSION {
        return Err(DecodeError::Version { found: version });
    }
    Ok((header, Message::take(code, body)?))
}
