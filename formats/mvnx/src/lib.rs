//! Recordings of the Xsens MVN suit in its open format, MVNX versions 3 and 4.
//!
//! [`Reader`] is streaming: it holds one frame in memory at a time, regardless of the file's length. [`Writer`] writes
//! simulated flights in the same format. `docs/recordings.md` describes what is read and how bad frames are handled.

pub mod closure;
pub mod field;
pub mod frame;
pub mod header;
pub mod length;
pub mod live;
mod number;
pub mod reader;
pub mod recording;
mod scanner;
mod source;
pub mod writer;
pub mod xsens;

pub use closure::ArmFrame;
pub use field::{Field, Fields, ReadOptions};
pub use frame::{Fault, Frame, FrameKind};
pub use header::Header;
pub use reader::Reader;
pub use writer::Writer;
pub use writer::{Differences, MovingFrame, rotation_rate};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
