//! Recordings of the Xsens MVN suit in their open form, MVNX versions 3 and 4.
//!
//! [`Reader`] streams: one frame is in memory at a time, whatever the length of the file. [`Writer`] makes
//! files of the same form from simulated flights. What is read, and what becomes of bad frames, is in
//! `docs/recordings.md`.

pub mod closure;
pub mod field;
pub mod frame;
pub mod header;
pub mod length;
pub mod live;
mod number;
pub mod reader;
mod scanner;
mod source;
pub mod writer;

pub use closure::ArmFrame;
pub use field::{Field, Fields};
pub use frame::{Fault, Frame, FrameKind};
pub use header::Header;
pub use reader::{ReadOptions, Reader};
pub use writer::Writer;
pub(crate) use writer::{Differences, MovingFrame, rotation_rate};
