//! The core on a Cortex-M33. Under QEMU's `-icount shift=7` an instruction takes 128 ns of virtual time, so the 20 MHz
//! SysTick makes 2.56 ticks of it. `cargo xtask on-target` runs it.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use bodyflight_on_target::{Pace, run};
use cortex_m::peripheral::Peripherals;
use cortex_m_rt::{ExceptionFrame, entry, exception};
use semihosting::{eprintln, process};

const PACE: Pace = Pace {
    ticks: 64,
    instructions: 25,
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
