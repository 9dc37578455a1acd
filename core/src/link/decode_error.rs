//! Reasons why frames are rejected.

use core::fmt;

use super::layout::PROTOCOL_VERSION;

/// Reason why a frame was rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum DecodeError {
    /// The bytes end before the frame is complete.
    Incomplete,
    /// The frame is not valid COBS: there is a delimiter inside a run, as after a lost or changed byte.
    Cobs,
    /// The frame is longer than any message.
    TooLong,
    /// The frame is shorter than header and checksum.
    TooShort,
    /// The checksum does not match.
    Checksum,
    /// The frame has another protocol version.
    Version {
        /// The version in the frame.
        found: u8,
    },
    /// No message has the type of the frame.
    UnknownType {
        /// The type in the frame.
        code: u8,
    },
    /// The length of the body does not match its type.
    Length {
        /// Length of the body (bytes).
        found: usize,
        /// Length expected for the type (bytes).
        expected: usize,
    },
    /// A number is infinite or NaN.
    NotFinite {
        /// Name of the field.
        field: &'static str,
    },
    /// A value is outside the range given in the byte table.
    OutOfRange {
        /// Name of the field.
        field: &'static str,
    },
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Incomplete => write!(f, "the frame is not complete"),
            Self::Cobs => write!(f, "a frame was cut or damaged"),
            Self::TooLong => write!(f, "a frame is longer than any message"),
            Self::TooShort => write!(f, "a frame is shorter than a header"),
            Self::Checksum => write!(f, "the checksum of a frame is wrong"),
            Self::Version { found } => write!(
                f,
                "protocol version {found} found, {PROTOCOL_VERSION} expected: update the older side"
            ),
            Self::UnknownType { code } => write!(f, "message type {code:#04x} is not known"),
            Self::Length { found, expected } => {
                write!(f, "a body has {found} bytes, {expected} expected")
            }
            Self::NotFinite { field } => write!(f, "{field} is not a finite number"),
            Self::OutOfRange { field } => write!(f, "{field} is out of range"),
        }
    }
}

impl core::error::Error for DecodeError {}
