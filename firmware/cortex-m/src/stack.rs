//! The stack's high water.

use core::sync::atomic::{AtomicU32, Ordering};

/// What the stack is filled with before the start.
const PAINT: u32 = 0xCCCC_CCCC;

/// Untouched bytes below the high water after which nothing deeper is looked for: as long as the longest frame.
const LONGEST_FRAME: u32 = 4096;

/// Lowest address that was found touched; 0 before the first look.
static LOWEST: AtomicU32 = AtomicU32::new(0);

#[allow(unsafe_code, reason = "the linker's marks of the stack")]
pub(crate) mod marks {
    unsafe extern "C" {
        static _stack_end: u32;
        static _stack_start: u32;
    }

    /// The lowest address of the stack.
    pub(crate) fn bottom() -> u32 {
        &raw const _stack_end as u32
    }

    /// Where the stack begins, growing down.
    pub(crate) fn top() -> u32 {
        &raw const _stack_start as u32
    }
}

/// Lets the processor itself watch the end of the stack: whatever would write below it faults.
#[cfg(armv8m)]
pub fn guard() {
    // SAFETY: the stack pointer is above the end of the stack.
    #[allow(unsafe_code, reason = "a register of the processor")]
    unsafe {
        cortex_m::register::msplim::write(marks::bottom());
    }
}

/// Bytes of stack that were never touched.
///
/// The first look goes over all of it; later ones go down from the lowest touched word until they have met as much
/// paint as the longest frame could leave untouched.
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
    #[allow(unsafe_code, reason = "looks at unused stack")]
    let word = unsafe { core::ptr::read_volatile(address as *const u32) };
    word == PAINT
}
