//! A unit on a serial line: its ports, what is streamed to it, what it says, and a unit of the host's own.

mod file_flash;
pub mod image;
pub mod log;
pub mod monitor;
pub mod ports;
pub mod stream;
pub mod virtual_unit;
