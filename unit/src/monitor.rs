//! Makes the output of a serial line readable: defmt logs of the unit and Xbus packets of a sensor.
//!
//! [`Defmt`] and [`Xbus`] accept bytes from any source, in pieces of any size; [`Input`] reads them from a serial port,
//! a file or standard input without blocking for long.

#[cfg(feature = "logs")]
mod defmt;
#[cfg(not(feature = "logs"))]
#[path = "monitor/without_defmt.rs"]
mod defmt;
mod findings;
mod input;
mod log_line;
mod reading;
mod xbus;

pub use defmt::Defmt;
pub use input::{Chunk, Input};
pub use log_line::{DefmtTotals, Line};
pub use reading::reading;
pub use xbus::{ItemTotals, PacketReading, Xbus, XbusTotals};
