//! Polls the executor and sleeps in between. Boards in QEMU share this file.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_executor::Spawner;
use embassy_executor::raw::Executor;
use static_cell::StaticCell;

static EXECUTOR: StaticCell<Executor> = StaticCell::new();
/// Whether the executor has been woken since it was last polled.
static PENDED: AtomicBool = AtomicBool::new(true);

#[allow(unsafe_code, reason = "the executor calls this symbol to be woken")]
#[unsafe(export_name = "__pender")]
fn pender(_: *mut ()) {
    PENDED.store(true, Ordering::Release);
}

/// Runs what `spawn` starts, forever.
pub(super) fn forever(spawn: impl FnOnce(Spawner)) -> ! {
    let executor = EXECUTOR.init_with(|| Executor::new(core::ptr::null_mut()));
    spawn(executor.spawner());
    loop {
        // SAFETY: the executor is polled only here, and never from within itself.
        #[allow(unsafe_code, reason = "the executor requires a single caller")]
        unsafe {
            executor.poll();
        }
        // QEMU treats WFE as a no-op, so embassy's own executor would spin; WFI sleeps. With interrupts masked no
        // wake-up is lost between the check and the sleep.
        cortex_m::interrupt::free(|_| {
            if !PENDED.swap(false, Ordering::Acquire) {
                cortex_m::asm::wfi();
            }
        });
    }
}
