//! A panic while the logger writes, which panics again as soon as the first panic is logged: at the second start the image
//! prints the fault record, which must be that of the first panic. `cargo xtask on-target` runs it.
#![no_std]
#![no_main]

use core::hint::black_box;

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::fault::Reset;
use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;
use semihosting::{println, process};

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
    stack::guard();
    let record = faults::begin(Reset::Software);
    let identity = record.identity(faults::build(), 0);
    if identity.fault_kind == 0 {
        faults::note(SEQUENCE);
        defmt::error!("{}", Unloggable);
    }
    // Ends the line that the logger has begun.
    println!();
    println!("reset_cause {}", identity.reset_cause);
    println!("fault_kind {}", identity.fault_kind);
    println!("fault_sequence {}", identity.fault_sequence);
    println!("fault_resets {}", identity.fault_resets);
    let place = core::str::from_utf8(&identity.fault_place).unwrap_or_default();
    println!("fault_place {}", place.trim_start_matches('\0'));
    process::exit(0)
}
