//! The unit's application, the same on every board: the serial link, the reduced filter, reports.
//!
//! A board gives ports (`embedded_io_async`), a time driver (`embassy_time`) and a [`Board`]; [`run()`] does the
//! rest. [`Unit`] is the same without ports, for tests and simulations in virtual time, and [`Computer`] is what
//! it computes, for whoever wants to check the answers. `docs/unit.md` shows how to add a board.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod board;
pub mod computer;
pub mod display;
pub mod fault;
pub mod light;
mod log;
pub mod ports;
mod queue;
pub mod recorder;
mod run;
pub mod sensor;
#[cfg(test)]
mod test_flight;
pub mod unit;

pub use board::{Board, Identity, RECEIVER_BYTES, millivolts};
pub use computer::Computer;
pub use run::{NoPort, run};
pub use unit::Unit;
