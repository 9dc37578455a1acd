//! What the Cortex-M boards share: panics and faults that are told after the next start, and the stack's
//! high water. Linking it brings the handlers of panics and hard faults.
#![cfg(target_os = "none")]
#![no_std]

use cortex_m::Peripherals;

pub mod faults;
mod retained;
pub mod stack;

/// Starts the counter of cycles.
pub fn count_cycles() {
    if let Some(mut core) = Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
}
