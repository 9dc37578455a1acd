//! The image.

use bodyflight_on_target::{Pace, run};
use cortex_m::peripheral::Peripherals;
use cortex_m_rt::entry;
// Linked for its vector table.
use lm3s6965 as _;
use semihosting::process;

const PACE: Pace = Pace {
    ticks: 8,
    instructions: 5,
};

#[entry]
fn main() -> ! {
    let done = Peripherals::take().and_then(|peripherals| run(peripherals.SYST, PACE));
    process::exit(if done.is_some() { 0 } else { 1 })
}
