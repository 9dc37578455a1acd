//! The image: ports, clock, fault handling, and the application on top.

mod time;
mod uart;

use core::cell::RefCell;
use core::sync::atomic::{AtomicBool, Ordering};

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::fault::Reset;
use bodyflight_firmware::recorder::storage::NoLog;
use bodyflight_firmware::{Board, Unit, run};
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;
use embassy_executor::raw::Executor;
use static_cell::StaticCell;

use uart::{Receiver, Transmitter, UART0, UART1};

/// The board as the application sees it.
struct Lm3s6965;

impl Board for Lm3s6965 {
    /// Ticks of the processor's clock. QEMU has no cycle counter, but SysTick runs at the same 12.5 MHz.
    fn cycles(&self) -> u32 {
        time::ticks()
    }

    fn stack_free(&self) -> u32 {
        stack::free()
    }

    fn line_errors(&self) -> [u32; 2] {
        UART0.errors()
    }

    /// The machine has no watchdog that survives QEMU's pauses.
    fn feed_watchdog(&self) {}

    fn note(&self, sequence: u32) {
        faults::note(sequence);
    }
}

static EXECUTOR: StaticCell<Executor> = StaticCell::new();
static UNIT: StaticCell<RefCell<Unit<Lm3s6965>>> = StaticCell::new();
/// Whether the executor has been woken since it was last polled.
static PENDED: AtomicBool = AtomicBool::new(true);

#[allow(unsafe_code, reason = "the executor calls this symbol to be woken")]
#[unsafe(export_name = "__pender")]
fn pender(_: *mut ()) {
    PENDED.store(true, Ordering::Release);
}

#[embassy_executor::task]
async fn application(unit: &'static RefCell<Unit<Lm3s6965>>) {
    run(
        unit,
        Receiver(&UART0),
        Transmitter(&UART0),
        Receiver(&UART1),
        NoLog,
    )
    .await;
}

#[entry]
fn main() -> ! {
    // The machine starts by power-on or after a fault; nothing else resets it.
    let record = faults::begin(Reset::Software);
    if let Some(mut peripherals) = Peripherals::take() {
        time::start(&mut peripherals.SYST);
        for port in [&UART0, &UART1] {
            port.start();
        }
    }
    // The counter has a different value at each start of the machine.
    let identity = record.identity(faults::build(), SYST::get_current() << 8);
    let unit = Unit::new_in(UNIT.uninit(), Lm3s6965, identity);
    let executor = EXECUTOR.init_with(|| Executor::new(core::ptr::null_mut()));
    match application(unit) {
        Ok(task) => executor.spawner().spawn(task),
        Err(_) => defmt::error!("the task is running already"),
    }
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
