//! The image.

use core::panic::PanicInfo;

use bodyflight_on_target::{Pace, run};
use cortex_m::peripheral::Peripherals;
use cortex_m_rt::{ExceptionFrame, entry, exception};
// Linked for its vector table.
use lm3s6965 as _;
use semihosting::{eprintln, process};

const PACE: Pace = Pace {
    ticks: 8,
    instructions: 5,
};

#[entry]
fn main() -> ! {
    let done = Peripherals::take().and_then(|peripherals| run(peripherals.SYST, PACE));
    process::exit(if done.is_some() { 0 } else { 1 })
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    eprintln!("{info}");
    process::exit(101)
}

#[allow(unsafe_code, reason = "the runtime hands over the faulting frame")]
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    eprintln!("{frame:?}");
    process::exit(102)
}
