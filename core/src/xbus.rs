//! Xbus, the serial protocol of Xsens MTi sensors, and MTData2, its measurement message.
//!
//! There are two levels. [`Decoder`] finds packets in arbitrary bytes; [`Packet::items`] iterates over the
//! measurements of a packet in place, and [`Item`] is a decoded measurement. Items of unknown type are skipped by
//! their size. [`Command`] and [`PacketWriter`] create the packets sent to a sensor. `docs/xbus.md` lists what is
//! supported. Source: MT Low Level Communication Protocol, MT0101P.
//!
//! ```
//! use bodyflight_core::xbus::{Decoder, Item};
//!
//! let line = [0xFA, 0xFF, 0x36, 0x05, 0x10, 0x20, 0x02, 0xDF, 0xC5, 0xF0];
//! let mut decoder = Decoder::<512>::new();
//! let mut input = line.as_slice();
//! while let Some(packet) = decoder.next(&mut input) {
//!     for item in packet.items() {
//!         assert_eq!(item.decode(), Ok(Item::PacketCounter(57_285)));
//!     }
//! }
//! assert_eq!(decoder.counters().packets, 1);
//! ```

mod clock;
mod command;
mod decoder;
mod gnss;
mod item;
mod number;
mod packet;

pub use clock::SampleClock;
pub use command::{Baudrate, Command, OutputSetting, PacketWriter};
pub use decoder::{Counters, Decoder};
pub use gnss::GnssPvt;
pub use item::{BadItem, CoordinateSystem, DataId, Item, Items, RawItem, Status, UtcTime};
pub use number::{NumberFormat, Reals};
pub use packet::{MAX_DATA_LENGTH, MAX_PACKET_LENGTH, MessageId, Packet};
