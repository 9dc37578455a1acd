//! The image: ports, clock, fault handling, and the application on top.

mod clock;
mod poll;
mod time;
mod uart;

use core::cell::RefCell;

use bodyflight_cortex_m::{faults, stack};
use bodyflight_firmware::fault::Reset;
use bodyflight_firmware::recorder::storage::NoLog;
use bodyflight_firmware::{Board, Unit, run};
use cortex_m::peripheral::{Peripherals, SYST};
use cortex_m_rt::entry;
// Linked for its logger.
use defmt_semihosting as _;
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

static UNIT: StaticCell<RefCell<Unit<Lm3s6965>>> = StaticCell::new();
#[embassy_executor::task]
async fn application(unit: &'static RefCell<Unit<Lm3s6965>>) {
    run(
        unit,
        Receiver(&UART0),
        Transmitter(&UART0),
        Receiver(&UART1),
        // The buffers of a log need 16 KiB, and an update the stack that is left: qemu-an505 has storage.
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
    poll::forever(|spawner| match application(unit) {
        Ok(task) => spawner.spawn(task),
        Err(_) => defmt::error!("the task is running already"),
    })
}
