//! The serial link between a host and the unit: messages, framing, and an exact account of losses.
//!
//! A frame is `00 | COBS(header, body, CRC-32C) | 00`. The delimiter on both sides costs one byte and prevents a
//! truncated frame from corrupting the next good one. All numbers are little-endian, every message has one fixed
//! length, and only frames that are complete, undamaged, of this version and in range are accepted. `docs/link.md`
//! lists every byte; its tables are checked against [`MESSAGES`].
//!
//! This module does no I/O: [`Message::encode`] fills a buffer, and [`Decoder::push`] accepts bytes from any
//! transport. A [`Ledger`] accounts for every sequence number, and [`fault::Injector`] simulates a faulty link.
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
mod calibration;
mod decode_error;
mod decoder;
pub mod fault;
mod flags;
mod frame;
mod kept;
mod layout;
mod ledger;
mod message;
mod packed_quaternion;
mod sample;
mod schema;
mod segment_values;
mod sensors;
mod setup;
mod status;
mod wire;

pub use block::{BLOCK_LENGTH, BlockReader, BlockWriter};
pub use calibration::{
    Calibrate, Calibration, CalibrationStage, CalibrationVerdict, ChainReport, LIMBS, LimbSensor,
    LimbTable, SegmentErrors,
};
pub use decode_error::DecodeError;
pub use decoder::{Counters, Decoder, Event};
pub use flags::{EstimateFlags, SensorParts, Validity};
pub(crate) use frame::checksum;
pub use frame::{EncodeError, Header, MAX_FRAME_LENGTH, MAX_PACKET_LENGTH};
pub use kept::{
    LogAction, LogAsk, LogPiece, PIECE_LENGTH, SetupAction, SetupAsk, SetupState, Stored,
};
pub use layout::{FieldLayout, MessageLayout, PROTOCOL_VERSION};
pub use ledger::{Arrival, Imbalance, Ledger};
pub use message::{
    ArchSource, Configure, Configured, Credit, Estimate, Hello, HelloAcknowledge, Message,
    ResetFilter, Sample, SegmentValues, SensorKind, Sensors, Start, Status, Stop, StreamMode,
    TimeSync, Verdict,
};
pub use packed_quaternion::PackedQuaternion;
pub use sample::Motion;
pub use schema::{HEADER, MESSAGES, SCHEMA_HASH};
pub use segment_values::SegmentTable;
pub use sensors::Readings;
pub use setup::{SETUP_LENGTH, Setup, SetupError};

#[cfg(test)]
mod tests;
