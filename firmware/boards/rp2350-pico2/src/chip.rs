//! Chip set-up besides the ports: watchdog, brown-out detector, cause of the reset, and the flash that holds the program
//! and, behind it, the log.

use bodyflight_firmware::fault::Reset;
use embassy_futures::yield_now;
use embassy_rp::Peri;
use embassy_rp::flash::{self, Blocking, PAGE_SIZE};
use embassy_rp::pac::{POWMAN, TICKS};
use embassy_rp::peripherals::{FLASH, WATCHDOG};
use embassy_rp::watchdog::Watchdog;
use embassy_time::Duration;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

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

/// Size of the flash (bytes), and where the log begins: `memory.x` leaves the first part to the program.
const CAPACITY: usize = 4 << 20;
const PROGRAM: u32 = 1 << 20;

/// Size of a sector (bytes).
const SECTOR: u32 = 4096;

/// Where log and configuration are stored.
pub(crate) const SETUP: core::ops::Range<u32> = CAPACITY as u32 - 2 * SECTOR..CAPACITY as u32;
pub(crate) const LOG: core::ops::Range<u32> = PROGRAM..SETUP.start;

/// The flash that the program runs from. While a sector is erased or a page written, the processor stops with its
/// interrupts off: 45 ms and 0.4 ms as a rule, 400 ms and 3 ms at most. Other tasks run between pages and sectors.
pub(crate) struct ProgramFlash(flash::Flash<'static, FLASH, Blocking, CAPACITY>);

impl ProgramFlash {
    pub(crate) fn new(flash: Peri<'static, FLASH>) -> Self {
        Self(flash::Flash::new_blocking(flash))
    }
}

impl ErrorType for ProgramFlash {
    type Error = flash::Error;
}

impl ReadNorFlash for ProgramFlash {
    const READ_SIZE: usize = flash::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), flash::Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for ProgramFlash {
    const WRITE_SIZE: usize = flash::WRITE_SIZE;
    const ERASE_SIZE: usize = flash::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), flash::Error> {
        for sector in (from..to).step_by(flash::ERASE_SIZE) {
            self.0.blocking_erase(sector, sector + SECTOR)?;
            yield_now().await;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), flash::Error> {
        let (mut place, mut rest) = (offset as usize, bytes);
        while !rest.is_empty() {
            let room = PAGE_SIZE - place % PAGE_SIZE;
            let (piece, after) = rest.split_at_checked(room).unwrap_or((rest, &[]));
            self.0.blocking_write(place as u32, piece)?;
            (place, rest) = (place + piece.len(), after);
            yield_now().await;
        }
        Ok(())
    }
}
