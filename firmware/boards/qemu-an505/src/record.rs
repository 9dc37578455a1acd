//! The start of an image that provokes a fault: the second start prints the fault record of the first.

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::fault::Reset;
use semihosting::{println, process};

/// Provokes a fault at the first start, while the sample `sequence` is being processed, and prints its record at the
/// second.
pub(crate) fn of_fault(sequence: u32, provoke: impl FnOnce()) -> ! {
    stack::guard();
    let record = faults::begin(Reset::Software);
    let identity = record.identity(faults::build(), 0);
    if identity.fault_kind == 0 {
        faults::note(sequence);
        provoke();
    }
    // Ends the line that a logger may have begun.
    println!();
    println!("reset_cause {}", identity.reset_cause);
    println!("fault_kind {}", identity.fault_kind);
    println!("fault_sequence {}", identity.fault_sequence);
    println!("fault_resets {}", identity.fault_resets);
    let place = core::str::from_utf8(&identity.fault_place).unwrap_or_default();
    println!("fault_place {}", place.trim_start_matches('\0'));
    process::exit(0)
}
