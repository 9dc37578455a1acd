//! A panic while the logger writes, which panics again as soon as the first panic is logged: at the second start the image
//! prints the fault record, which must be that of the first panic. `cargo xtask on-target` runs it.
#![no_std]
#![no_main]

mod record;

use core::hint::black_box;

use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;

/// The sample being processed when the logger panics.
const SEQUENCE: u32 = 4712;

/// A value that cannot be logged.
struct Unloggable;

impl defmt::Format for Unloggable {
    fn format(&self, _: defmt::Formatter<'_>) {
        let places = [0_u8; 1];
        black_box(places[black_box(1)]);
    }
}

#[entry]
fn main() -> ! {
    record::of_fault(SEQUENCE, || defmt::error!("{}", Unloggable))
}
