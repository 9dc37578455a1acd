//! NOR flash that outlives the unit.

use std::rc::Rc;
use std::vec;
use std::vec::Vec;

use core::cell::RefCell;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

use super::super::Recorder;
use super::super::storage::{EraseAhead, FlightLog};

pub(super) const SECTOR: usize = 4096;
pub(super) const SECTORS: usize = 48;
pub(super) const SETUP_SECTORS: usize = 2;

/// NOR flash whose power fails after a given number of bytes: the write or erase in progress is then only partly done.
pub(super) struct Flash {
    pub(super) bytes: Vec<u8>,
    /// Bytes that can still be written or erased before the power fails.
    pub(super) power: usize,
    /// Random contents of cells that lost power during a change.
    pub(super) noise: u32,
    /// Addresses at which nothing can be read.
    pub(super) unreadable: core::ops::Range<u32>,
}

#[derive(Debug, PartialEq)]
pub(super) struct NoPower;

impl NorFlashError for NoPower {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// The chip, which outlives the unit when the power fails.
#[derive(Clone)]
pub(super) struct Chip(pub(super) Rc<RefCell<Flash>>);

impl Chip {
    /// Where the log is stored.
    pub(super) const LOG: core::ops::Range<u32> = 0..(SECTOR * SECTORS) as u32;
    /// Where the configuration is stored, beyond the log.
    pub(super) const SETUP: core::ops::Range<u32> =
        (SECTOR * SECTORS) as u32..(SECTOR * (SECTORS + SETUP_SECTORS)) as u32;

    pub(super) fn new(power: usize, noise: u32) -> Self {
        Self(Rc::new(RefCell::new(Flash {
            bytes: vec![0xff; SECTOR * (SECTORS + SETUP_SECTORS)],
            power,
            noise,
            unreadable: 0..0,
        })))
    }

    /// The log of `recorder` on this chip.
    pub(super) fn log<'a>(&self, recorder: &'a Recorder) -> FlightLog<'a, Self> {
        let ahead = EraseAhead::OWN_CHIP;
        FlightLog::new(recorder, self.clone(), Self::LOG, Self::SETUP, ahead)
    }

    pub(super) fn has_power(&self) -> bool {
        self.0.borrow().power > 0
    }
}

impl Flash {
    /// How many of `length` bytes are processed before the power fails, and whether that is all of them.
    fn spend(&mut self, length: usize) -> usize {
        let powered = self.power.min(length);
        if self.power != usize::MAX {
            self.power -= powered;
        }
        powered
    }

    pub(super) fn noise(&mut self) -> u8 {
        self.noise = self
            .noise
            .wrapping_mul(1_664_525)
            .wrapping_add(1_013_904_223);
        (self.noise >> 24) as u8
    }
}

impl ErrorType for Chip {
    type Error = NoPower;
}

impl ReadNorFlash for Chip {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NoPower> {
        let flash = self.0.borrow();
        if flash.power == 0 || flash.unreadable.contains(&offset) {
            return Err(NoPower);
        }
        bytes.copy_from_slice(&flash.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        SECTOR * (SECTORS + SETUP_SECTORS)
    }
}

impl NorFlash for Chip {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), NoPower> {
        let flash = &mut *self.0.borrow_mut();
        if flash.power == 0 {
            return Err(NoPower);
        }
        let length = (to - from) as usize;
        let powered = flash.spend(length);
        for place in 0..length {
            // A sector is erased as a whole: if power fails during the erase, its cells are random.
            let noise = flash.noise();
            let cell = &mut flash.bytes[from as usize + place];
            *cell = if powered == length {
                0xff
            } else {
                *cell | noise
            };
        }
        if powered == length {
            Ok(())
        } else {
            Err(NoPower)
        }
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NoPower> {
        let flash = &mut *self.0.borrow_mut();
        if flash.power == 0 {
            return Err(NoPower);
        }
        let powered = flash.spend(bytes.len());
        for (place, byte) in bytes.iter().enumerate().take(powered + 1) {
            let noise = if place < powered { 0 } else { flash.noise() };
            let cell = &mut flash.bytes[offset as usize + place];
            *cell &= byte | noise;
        }
        if powered == bytes.len() {
            Ok(())
        } else {
            Err(NoPower)
        }
    }
}
