//! The core on a Cortex-M33. Under QEMU's `-icount shift=7` an instruction takes 128 ns of virtual time, which is 2.56
//! ticks of the 20 MHz SysTick. `cargo xtask on-target` runs it.
#![no_std]
#![no_main]

use bodyflight_on_target::{Pace, run};
use cortex_m::peripheral::Peripherals;
use cortex_m_rt::entry;
use semihosting::process;

const PACE: Pace = Pace {
    ticks: 64,
    instructions: 25,
};

#[entry]
fn main() -> ! {
    let done = Peripherals::take().and_then(|peripherals| run(peripherals.SYST, PACE));
    process::exit(if done.is_some() { 0 } else { 1 })
}
