//! Chip set-up besides the ports: watchdog, brown-out detector, and cause of the reset.

use bodyflight_firmware::fault::Reset;
use embassy_rp::pac::{POWMAN, TICKS};
use embassy_rp::peripherals::WATCHDOG;
use embassy_rp::watchdog::Watchdog;
use embassy_time::Duration;

/// Watchdog timeout: four heartbeats.
pub(crate) const TIMEOUT: Duration = Duration::from_secs(1);

/// Watchdog timeout while the clocks are set, in microseconds of a crystal of 12 MHz. The ring oscillator counts them, at
/// about 11 MHz after a reset, at 5 MHz to 150 MHz in any case: so these are 0.3 to 10 s. The crystal takes 0.13 s.
const STARTING: Duration = Duration::from_secs(4);

/// Cycles of the reference clock in a tick of the watchdog (1 us of the crystal); the same value is set with the clocks.
const TICK: u32 = 12;

/// Mark left in a scratch register that only a loss of power or the RUN pin clears.
const STARTED: u32 = 0xb0d7_f117;

/// Key in the upper half of what is written to the power manager.
const KEY: u32 = 0x5afe << 16;

/// Code of the brown-out level 0.946 V. The core needs 1.1 V, and the chip's own choice is 0.86 V.
const LEVEL: u8 = 0b0_1011;

/// Starts the watchdog, which counts cycles of the reference clock. After a reset that clock is the ring oscillator, so it
/// runs before any clock is set. Also returns the cause of the reset.
#[allow(
    unsafe_code,
    reason = "runs before the clocks are set, when there are no peripherals to own"
)]
pub(crate) fn watchdog() -> (Watchdog, Reset) {
    // SAFETY: nothing else uses the watchdog.
    let peripheral = unsafe { WATCHDOG::steal() };
    let mut watchdog = Watchdog::new(peripheral);
    let cause = reset(&mut watchdog);
    TICKS.watchdog_cycles().write(|cycles| cycles.0 = TICK);
    TICKS.watchdog_ctrl().write(|tick| tick.set_enable(true));
    watchdog.start(STARTING);
    (watchdog, cause)
}

/// Cause of the chip's reset. A reset by the program keeps the flags of the previous start, but it also keeps the mark,
/// which reveals it.
fn reset(watchdog: &mut Watchdog) -> Reset {
    let flags = POWMAN.chip_reset().read();
    let marked = watchdog.get_scratch(0) == STARTED;
    watchdog.set_scratch(0, STARTED);
    match marked {
        true if watchdog.reset_reason().is_some() => Reset::Watchdog,
        true => Reset::Software,
        false if flags.had_por() => Reset::Power,
        false if flags.had_bor() => Reset::BrownOut,
        false => Reset::Other,
    }
}

/// Enables the detector of brown-outs of the core's supply.
pub(crate) fn guard_supply() {
    POWMAN.bod().modify(|detector| {
        detector.set_vsel(LEVEL);
        detector.set_en(true);
        detector.0 = detector.0 & 0xffff | KEY;
    });
}
