//! Makes the output of a serial line readable: defmt logs of the unit and Xbus packets of a sensor.
//!
//! [`Defmt`] and [`Xbus`] accept bytes from any source, in pieces of any size; [`Input`] reads them from a serial port,
//! a file or standard input without blocking for long.

mod defmt;
mod input;
mod reading;
mod xbus;

pub use defmt::{Defmt, DefmtTotals, Line};
pub use input::{Chunk, Input};
pub use reading::reading;
pub use xbus::{ItemTotals, PacketReading, Xbus, XbusTotals};
