//! A unit on a serial line: ports, streaming to it, reading its output and its log, and a virtual unit on this machine.

mod block_on;
pub mod calibration;
mod file_flash;
pub mod image;
pub mod log;
pub mod monitor;
pub mod ports;
mod request;
pub mod sensor_line;
pub mod setup;
pub mod stream;
pub mod virtual_unit;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
