//! What comes out of a serial line, made readable: defmt logs of the unit and Xbus packets of a sensor.
//!
//! [`Defmt`] and [`Xbus`] take bytes in pieces of any size from anywhere; [`Input`] brings them from a serial
//! port, a file or standard input without ever blocking for long.

mod defmt;
mod input;
mod reading;
mod xbus;

pub use defmt::{Defmt, DefmtTotals, Line};
pub use input::{Chunk, Input};
pub use reading::reading;
pub use xbus::{ItemTotals, PacketReading, Xbus, XbusTotals};
