//! A stack overflow on a processor with a stack limit: at the second start the image prints the fault record of the
//! first. `cargo xtask on-target` runs it.
#![no_std]
#![no_main]

mod record;

use core::hint::black_box;

use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;
use semihosting::println;

/// The sample being processed when the stack overflows.
const SEQUENCE: u32 = 4711;

/// Recurses far deeper than the stack, in a way that the compiler cannot turn into a loop.
#[inline(never)]
fn deeper(depth: u32) -> u32 {
    if black_box(depth) == u32::MAX {
        return 0;
    }
    let mut room = [depth; 64];
    black_box(&mut room);
    let below = deeper(black_box(depth + 1));
    room[depth as usize % 64].wrapping_add(below)
}

#[entry]
fn main() -> ! {
    record::of_fault(SEQUENCE, || println!("never {}", deeper(0)))
}
