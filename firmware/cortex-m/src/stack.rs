//! Measures the stack's high-water mark.

use core::sync::atomic::{AtomicU32, Ordering};

/// Pattern that fills the stack before the start.
const PAINT: u32 = 0xCCCC_CCCC;

/// Number of untouched bytes after which the search for the high-water mark ends: the length of the longest frame.
const LONGEST_FRAME: u32 = 4096;

/// Lowest touched address found so far; 0 before the first search.
static LOWEST: AtomicU32 = AtomicU32::new(0);

#[allow(unsafe_code, reason = "symbols of the linker script")]
pub(crate) mod marks {
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }

    /// The lowest address of the stack.
    pub(crate) fn bottom() -> u32 {
        &raw const _stack_end as u32
    }

    /// The highest address of the stack, which grows down.
    pub(crate) fn top() -> u32 {
        &raw const _stack_start as u32
    }
}

/// Sets the processor's stack limit, so that a write below the stack faults.
#[cfg(armv8m)]
pub fn guard() {
    // SAFETY: the stack pointer is above the end of the stack.
    #[allow(unsafe_code, reason = "accesses a register of the processor")]
    unsafe {
        cortex_m::register::msplim::write(marks::bottom());
    }
}

/// Number of stack bytes that were never used.
///
/// The first call searches the whole stack. Later calls continue down from the lowest touched word until they have
/// found as much untouched memory as the longest frame may skip.
pub fn free() -> u32 {
    let bottom = marks::bottom();
    let pointer = cortex_m::register::msp::read().clamp(bottom, marks::top());
    let known = LOWEST.load(Ordering::Relaxed);
    let lowest = if known == 0 {
        let touched = (bottom..pointer).step_by(4).find(|&word| !painted(word));
        touched.unwrap_or(pointer)
    } else {
        let mut lowest = known.min(pointer);
        let mut word = lowest;
        while word > bottom && lowest - word < LONGEST_FRAME {
            word -= 4;
            if !painted(word) {
                lowest = word;
            }
        }
        lowest
    };
    LOWEST.store(lowest, Ordering::Relaxed);
    lowest - bottom
}

fn painted(address: u32) -> bool {
    // SAFETY: aligned words of the stack.
    #[allow(unsafe_code, reason = "reads and writes unused stack memory")]
    let word = unsafe { core::ptr::read_volatile(address as *const u32) };
    word == PAINT
}
