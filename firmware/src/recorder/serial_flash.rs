//! Driver for SPI NOR flash: sectors of 4 KiB, pages of 256 bytes, and the commands common to all makers (JEDEC's basic
//! ones, with addresses of three bytes).

use core::ops::Range;

use embedded_hal::digital::OutputPin;
use embedded_hal::spi::SpiBus;
use embedded_hal_async::delay::DelayNs;
use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Size of a sector, the unit of erasing (bytes).
pub const SECTOR: u32 = 4096;

/// Size of a page, the most that one command can write (bytes).
const PAGE: u32 = 256;

const READ: u8 = 0x03;
const PROGRAM: u8 = 0x02;
const ERASE_SECTOR: u8 = 0x20;
const ENABLE_WRITING: u8 = 0x06;
const STATUS: u8 = 0x05;
const IDENTIFY: u8 = 0x9f;
const WAKE: u8 = 0xab;

/// Status bit: a write or erase is in progress.
const BUSY: u8 = 1;

/// Time that a chip needs to wake up (us).
const WAKING: u32 = 50;

/// Polling intervals (us) and numbers of polls while a page is written and while a sector is erased. Chips take 3 ms
/// and 400 ms at most; the watchdog resets the unit after a second.
const WRITING: [u32; 2] = [100, 100];
const ERASING: [u32; 2] = [2_000, 225];

/// Capacities of usable chips, as base-two logarithms: 64 KiB to 16 MiB, the most that three address bytes can reach.
const CAPACITIES: core::ops::RangeInclusive<u8> = 16..=24;

/// A flash chip with its own select pin.
#[derive(Debug)]
pub struct SerialFlash<B, P, D> {
    bus: B,
    select: P,
    delay: D,
    capacity: u32,
}

/// Where log and configuration are stored in a memory of this capacity (bytes) that stores nothing else: the
/// configuration in the last two sectors. Also the layout of files that stand for such a memory.
pub const fn parts(capacity: u32) -> [Range<u32>; 2] {
    let setup = capacity.saturating_sub(2 * SECTOR);
    [0..setup, setup..capacity]
}

/// Errors of the chip.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FlashError {
    /// The bus or the select pin failed.
    Bus,
    /// The chip stayed busy longer than it may.
    Busy,
    /// The address is beyond the end of the chip.
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
    /// Wakes the chip and reads its identity; returns `None` if no chip answers.
    pub async fn find(bus: B, select: P, delay: D) -> Option<Self> {
        let mut flash = Self {
            bus,
            select,
            delay,
            capacity: 0,
        };
        flash.command(&[WAKE], &[], &mut []).ok()?;
        flash.delay.delay_us(WAKING).await;
        // A chip that is still erasing after a processor reset does not answer until it is done.
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

    /// Where log and configuration are stored.
    pub fn parts(&self) -> [Range<u32>; 2] {
        parts(self.capacity)
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

    /// Waits until the chip is ready, while other tasks run.
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

/// Encodes a command with a three-byte address.
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
            // Writes must not cross a page boundary, wherever they begin.
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
