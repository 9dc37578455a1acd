//! The unit's application, the same on every board: the serial link, the filters, status reports and the log.
//!
//! A board provides ports (`embedded_io_async`), a time driver (`embassy_time`) and a [`Board`]; [`run()`] does the
//! rest. [`Unit`] is the same application without ports, for tests and simulations in virtual time. [`Computer`] is its
//! computation alone, with which a host can verify the unit's answers. `docs/unit.md` shows how to add a board.
#![no_std]
#![forbid(unsafe_code)]

#[cfg(test)]
extern crate std;

pub mod board;
pub mod computer;
pub mod display;
pub mod fault;
pub mod light;
#[cfg(feature = "chain")]
pub mod limbs;
#[cfg(not(feature = "chain"))]
#[path = "no_limbs.rs"]
pub mod limbs;
mod log;
pub mod node;
pub mod ports;
mod queue;
pub mod recorder;
mod run;
pub mod sensor;
#[cfg(test)]
mod test_flight;
#[cfg(test)]
mod test_line;
#[cfg(test)]
mod test_spi;
pub mod unit;

pub use board::{Board, Identity, RECEIVER_BYTES, millivolts};
pub use computer::Computer;
pub use run::{NoPort, run, start};
pub use unit::Unit;
