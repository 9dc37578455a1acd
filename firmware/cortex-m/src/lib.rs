//! Shared code of the Cortex-M boards: panics and faults that are reported after the next start, and the stack's
//! high-water mark. Linking it provides the handlers of panics and hard faults.
#![cfg(target_os = "none")]
#![no_std]

use cortex_m::Peripherals;

pub mod faults;
mod retained;
pub mod stack;

/// Starts the cycle counter.
pub fn count_cycles() {
    if let Some(mut core) = Peripherals::take() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
}
