//! The serial link between a host and the unit: messages, framing, losses counted exactly.
//!
//! A frame is `00 | COBS(header, body, CRC-32C) | 00`. The delimiter on both sides is one byte that keeps
//! a cut frame from taking the next good one with it. All numbers are little-endian, every message has
//! one fixed length, and nothing is accepted that is not complete, whole, of this version and in range.
//! `docs/link.md` lists every byte; its tables are checked against [`MESSAGES`].
//!
//! Nothing here does input or output: [`Message::encode`] fills a buffer, [`Decoder::push`] takes bytes
//! from wherever they come. A [`Ledger`] accounts for every sequence number, and [`fault::Injector`]
//! breaks a link on purpose.
//!
//! ```
//! use bodyflight_core::link::{Decoder, Event, Header, Message, Stop, MAX_FRAME_LENGTH};
//!
//! let mut frame = [0; MAX_FRAME_LENGTH];
//! let header = Header { session: 1, sequence: 7, time: 29_167 };
//! let length = Message::Stop(Stop { sent: 8 }).encode(&header, &mut frame).unwrap();
//!
//! let mut decoder = Decoder::new();
//! let mut events = frame[..length].iter().filter_map(|&byte| decoder.push(byte));
//! assert_eq!(events.next(), Some(Event::Frame(header, Message::Stop(Stop { sent: 8 }))));
//! ```

mod arch;
mod block;
mod decode_error;
mod decoder;
pub mod fault;
mod flags;
mod frame;
mod layout;
mod ledger;
mod message;
mod packed_quaternion;
mod sample;
mod schema;
mod segment_values;
mod status;
mod wire;

pub use block::{BLOCK_LENGTH, BlockReader, BlockWriter};
pub use decode_error::DecodeError;
pub use decoder::{Counters, Decoder, Event};
pub use flags::{EstimateFlags, Validity};
pub use frame::{EncodeError, Header, MAX_FRAME_LENGTH, MAX_PACKET_LENGTH};
pub use layout::{FieldLayout, MessageLayout, PROTOCOL_VERSION};
pub use ledger::{Arrival, Imbalance, Ledger};
pub use message::{
    ArchSource, Configure, Configured, Credit, Estimate, Hello, HelloAcknowledge, LogAction,
    LogAsk, LogPiece, Message, PIECE_LENGTH, ResetFilter, Sample, SegmentValues, Start, Status,
    Stop, StreamMode, TimeSync, Verdict,
};
pub use packed_quaternion::PackedQuaternion;
pub use sample::Motion;
pub use schema::{HEADER, MESSAGES, SCHEMA_HASH};
pub use segment_values::SegmentTable;

#[cfg(test)]
mod tests;
