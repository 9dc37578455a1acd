//! NOR flash on SPI, as boards have it beside the processor: sectors of 4 KiB, pages of 256 bytes, and the commands that the
//! chips of all makers share (JEDEC's basic ones, addresses of three bytes).

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use embedded_hal_async::delay::DelayNs;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use sequential_storage::cache::page_pointers::ArrayPagePointers;
use sequential_storage::cache::page_states::ArrayPageStates;
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::queue::{QueueConfig, QueueStorage};

/// Bytes of a sector, which is erased at once.
pub const SECTOR: u32 = 4096;

/// Bytes of a page, the most that are written at once.
const PAGE: u32 = 256;

const READ: u8 = 0x03;
const PROGRAM: u8 = 0x02;
const ERASE_SECTOR: u8 = 0x20;
const ENABLE_WRITING: u8 = 0x06;
const STATUS: u8 = 0x05;
const IDENTIFY: u8 = 0x9f;
const WAKE: u8 = 0xab;

/// Of the status: it writes or erases.
const BUSY: u8 = 1;

/// Time that a chip takes to wake (us).
const WAKING: u32 = 50;

/// Looks at the status while a page is written and while a sector is erased: time from one to the next (us), and how many.
/// Chips take 3 ms and 400 ms at most; a watchdog bites after a second.
const WRITING: [u32; 2] = [100, 100];
const ERASING: [u32; 2] = [2_000, 225];

/// Base-two logarithms of capacities that three bytes address and that hold a log.
const CAPACITIES: core::ops::RangeInclusive<u8> = 16..=24;

/// A chip behind its own select pin.
#[derive(Debug)]
pub struct SerialFlash<B, P, D> {
    bus: B,
    select: P,
    delay: D,
    capacity: u32,
}

/// Bytes that a log uses, and their sectors, which are kept in mind.
const LOG: u32 = 2 << 20;
const SECTORS: usize = (LOG / SECTOR) as usize;

/// What is kept in mind of the sectors, so that a block is written without a search.
pub type Sectors = Cache<ArrayPageStates<SECTORS>, ArrayPagePointers<SECTORS>, Uncached>;

/// What went wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlashError {
    /// The bus or the pin refused.
    Bus,
    /// The chip is still busy after the longest time that it may take.
    Busy,
    /// Beyond the end of the chip.
    OutOfBounds,
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::OutOfBounds => NorFlashErrorKind::OutOfBounds,
            Self::Bus | Self::Busy => NorFlashErrorKind::Other,
        }
    }
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> SerialFlash<B, P, D> {
    /// Wakes the chip and asks what it is; `None` where none answers.
    pub async fn find(bus: B, select: P, delay: D) -> Option<Self> {
        let mut flash = Self {
            bus,
            select,
            delay,
            capacity: 0,
        };
        flash.command(&[WAKE], &[], &mut []).ok()?;
        flash.delay.delay_us(WAKING).await;
        // A chip that goes on erasing after a reset of the processor says nothing until it is done.
        let [interval, looks] = ERASING;
        for _ in 0..looks {
            let mut identity = [0; 3];
            flash.command(&[IDENTIFY], &[], &mut identity).ok()?;
            let [maker, _, capacity] = identity;
            if !matches!(maker, 0 | 0xff) {
                flash.capacity = 1u32.checked_shl(capacity.into()).unwrap_or_default();
                return CAPACITIES.contains(&capacity).then_some(flash);
            }
            flash.delay.delay_us(interval).await;
        }
        None
    }

    /// The chip as a queue of blocks, for a [`FlightLog`](super::storage::FlightLog).
    pub fn queue(self) -> QueueStorage<Self, Sectors> {
        let end = self.capacity.min(LOG);
        let kept = Cache::new(ArrayPageStates::new(), ArrayPagePointers::new(), Uncached);
        QueueStorage::new(self, QueueConfig::new(0..end), kept)
    }

    fn command(&mut self, head: &[u8], written: &[u8], read: &mut [u8]) -> Result<(), FlashError> {
        self.select.set_low().map_err(|_| FlashError::Bus)?;
        let done = self
            .bus
            .write(head)
            .and_then(|()| self.bus.write(written))
            .and_then(|()| self.bus.read(read))
            .and_then(|()| self.bus.flush());
        self.select.set_high().map_err(|_| FlashError::Bus)?;
        done.map_err(|_| FlashError::Bus)
    }

    /// Waits until the chip is ready; other tasks go on meanwhile.
    async fn finish(&mut self, [interval, looks]: [u32; 2]) -> Result<(), FlashError> {
        for _ in 0..looks {
            let mut status = [BUSY];
            self.command(&[STATUS], &[], &mut status)?;
            if status[0] & BUSY == 0 {
                return Ok(());
            }
            self.delay.delay_us(interval).await;
        }
        Err(FlashError::Busy)
    }

    fn check(&self, offset: u32, length: usize) -> Result<(), FlashError> {
        let length = u32::try_from(length).ok();
        let end = length.and_then(|length| offset.checked_add(length));
        if end.is_some_and(|end| end <= self.capacity) {
            Ok(())
        } else {
            Err(FlashError::OutOfBounds)
        }
    }
}

/// A command with its address.
fn at(command: u8, address: u32) -> [u8; 4] {
    let [_, high, middle, low] = address.to_be_bytes();
    [command, high, middle, low]
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> ErrorType for SerialFlash<B, P, D> {
    type Error = FlashError;
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> ReadNorFlash for SerialFlash<B, P, D> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.check(offset, bytes.len())?;
        self.command(&at(READ, offset), &[], bytes)
    }

    fn capacity(&self) -> usize {
        self.capacity as usize
    }
}

impl<B: SpiBus, P: OutputPin, D: DelayNs> NorFlash for SerialFlash<B, P, D> {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR as usize;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        self.check(from, to.saturating_sub(from) as usize)?;
        for sector in (from..to).step_by(SECTOR as usize) {
            self.command(&[ENABLE_WRITING], &[], &mut [])?;
            self.command(&at(ERASE_SECTOR, sector), &[], &mut [])?;
            self.finish(ERASING).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.check(offset, bytes.len())?;
        let (mut place, mut rest) = (offset, bytes);
        while !rest.is_empty() {
            // A page ends where it ends, wherever writing began.
            let room = (PAGE - place % PAGE) as usize;
            let (piece, after) = rest.split_at_checked(room).unwrap_or((rest, &[]));
            self.command(&[ENABLE_WRITING], &[], &mut [])?;
            self.command(&at(PROGRAM, place), piece, &mut [])?;
            self.finish(WRITING).await?;
            place += PAGE - place % PAGE;
            rest = after;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
