//! The flash that holds the program and, behind it, the log.

use embassy_futures::yield_now;
use embassy_rp::Peri;
use embassy_rp::flash::{self, Blocking, PAGE_SIZE};
use embassy_rp::peripherals::FLASH;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

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
