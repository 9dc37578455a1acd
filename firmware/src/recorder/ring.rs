//! The log's ring of slots.
//!
//! Slot `n` of the log is at place `n` modulo the number of places, so the number in a header is checked by its place,
//! and the number of a slot with a damaged header is known from its neighbours.

use core::ops::Range;

use bodyflight_core::link::BLOCK_LENGTH;
use embedded_storage_async::nor_flash::NorFlash;

use super::Block;
use super::slots::{Content, Failed, HEADER, Memory, Slot, sector_size};

/// Length of a slot (bytes): four fill a sector of 4 KiB.
const SLOT: u32 = 1024;

const _: () = assert!(HEADER + BLOCK_LENGTH == SLOT as usize, "a block fits");

/// Largest number of a slot: more than any chip can write.
const LARGEST: u32 = 1 << 31;

/// The part of the memory that holds the log: a ring of sectors.
#[derive(Debug, Clone)]
pub(super) struct SlotRing {
    range: Range<u32>,
    /// Numbers of the oldest slot that is kept and of the next to be written.
    pub(super) oldest: u32,
    pub(super) next: u32,
    /// Number of erased sectors after the one that is being written.
    pub(super) erased: u32,
}

impl SlotRing {
    pub(super) const fn new(range: Range<u32>) -> Self {
        Self {
            range,
            oldest: 0,
            next: 0,
            erased: 0,
        }
    }

    fn per_sector<S: NorFlash>() -> u32 {
        sector_size::<S>() / SLOT
    }

    /// Number of sectors.
    pub(super) fn sectors<S: NorFlash>(&self) -> u32 {
        (self.range.end - self.range.start) / sector_size::<S>()
    }

    /// Number of slots that fit, at least one.
    fn places<S: NorFlash>(&self) -> u32 {
        (self.sectors::<S>() * Self::per_sector::<S>()).max(1)
    }

    fn address<S: NorFlash>(&self, number: u32) -> u32 {
        self.range.start + number % self.places::<S>() * SLOT
    }

    /// Finds the log in the memory.
    pub(super) async fn find<S: NorFlash>(&mut self, memory: &mut Memory<S>) {
        let places = self.places::<S>();
        (self.oldest, self.next, self.erased) = (0, 0, 0);
        let mut newest = None;
        for place in 0..places {
            let found = memory.number(self.address::<S>(place)).await;
            let found = found.unwrap_or_default();
            newest = newest.max(found.filter(|n| n % places == place && *n < LARGEST));
        }
        let Some(newest) = newest else { return };
        let next = newest.saturating_add(1);
        (self.oldest, self.next) = (newest, next);
        for number in next.saturating_sub(places)..newest {
            if memory.number(self.address::<S>(number)).await == Ok(Some(number)) {
                self.oldest = number;
                break;
            }
        }
        // Damage before the oldest whole slot is a part of the log if it is in the same sector, or if nothing was
        // overwritten yet, because at most half is erased ahead. Otherwise it is what an erase left that was cut short.
        let start = match newest < places / 2 {
            true => 0,
            false => self.oldest - self.oldest % Self::per_sector::<S>(),
        };
        while self.oldest > start
            && memory.slot(self.address::<S>(self.oldest - 1)).await == Slot::Damaged
        {
            self.oldest -= 1;
        }
        self.pass_remains(memory).await;
    }

    /// Passes what was not finished, and whole sectors that hold something but no slot that can be read: they must be
    /// the newest ones, because what is older than those has numbers and what is newer is erased.
    async fn pass_remains<S: NorFlash>(&mut self, memory: &mut Memory<S>) {
        let per_sector = Self::per_sector::<S>();
        while !self.next.is_multiple_of(per_sector) {
            let address = self.address::<S>(self.next);
            if memory.is_erased(address..address + SLOT).await {
                return;
            }
            self.next = self.next.saturating_add(1);
        }
        let kept = self.oldest.saturating_add(self.places::<S>());
        while self.next.saturating_add(2 * per_sector) <= kept {
            let mut is_damaged = false;
            for number in self.next..self.next.saturating_add(per_sector) {
                match memory.slot(self.address::<S>(number)).await {
                    Slot::Written(_) => return,
                    Slot::Damaged => is_damaged = true,
                    Slot::Empty => {}
                }
            }
            if !is_damaged {
                return;
            }
            self.next = self.next.saturating_add(per_sector);
        }
    }

    /// Makes sure that one more sector is erased, the oldest.
    pub(super) async fn erase_one<S: NorFlash>(
        &mut self,
        memory: &mut Memory<S>,
    ) -> Result<(), Failed> {
        let per_sector = Self::per_sector::<S>();
        let first = self.next.next_multiple_of(per_sector) + self.erased * per_sector;
        let start = self.address::<S>(first);
        let sector = start..start + sector_size::<S>();
        let end = (first + per_sector).saturating_sub(self.places::<S>());
        self.oldest = self.oldest.max(end).min(self.next);
        if !memory.is_erased(sector.clone()).await {
            memory.erase(sector).await?;
        }
        self.erased += 1;
        Ok(())
    }

    /// Writes a block into the next slot that is erased. A slot or sector that fails is passed, and so is a slot that lost
    /// bits after its sector was erased.
    pub(super) async fn append<S: NorFlash>(
        &mut self,
        memory: &mut Memory<S>,
        block: &Block,
    ) -> Result<(), Failed> {
        let per_sector = Self::per_sector::<S>();
        for _ in 0..per_sector {
            if self.next.is_multiple_of(per_sector) {
                if self.erased == 0
                    && let Err(failed) = self.erase_one(memory).await
                {
                    self.next = self.next.saturating_add(per_sector);
                    return Err(failed);
                }
                self.erased -= 1;
            }
            let number = self.next;
            self.next = number.saturating_add(1);
            let address = self.address::<S>(number);
            if memory.is_erased(address..address + SLOT).await {
                return memory.write(address, number, block.bytes()).await;
            }
        }
        Err(Failed)
    }

    /// Reads the slot with this number.
    pub(super) async fn read<'b, S: NorFlash>(
        &self,
        memory: &mut Memory<S>,
        number: u32,
        buffer: &'b mut [u8; BLOCK_LENGTH],
    ) -> Content<'b> {
        if number < self.oldest {
            return Content::Damaged(&[]);
        }
        let address = self.address::<S>(number);
        memory.read(address, number, buffer).await
    }

    /// Whether there is something in the slot with this number, whole or damaged.
    pub(super) async fn holds<S: NorFlash>(&self, memory: &mut Memory<S>, number: u32) -> bool {
        number < self.oldest || memory.slot(self.address::<S>(number)).await != Slot::Empty
    }

    /// Erases one sector of the log, by its place; `false` if there is no such sector.
    pub(super) async fn erase_place<S: NorFlash>(
        &mut self,
        memory: &mut Memory<S>,
        place: u32,
    ) -> bool {
        if place >= self.sectors::<S>() {
            (self.oldest, self.next) = (0, 0);
            self.erased = 0;
            return false;
        }
        let start = self.range.start + place * sector_size::<S>();
        let sector = start..start + sector_size::<S>();
        if !memory.is_erased(sector.clone()).await {
            // A sector that cannot be erased is passed when the log reaches it.
            let _ = memory.erase(sector).await;
        }
        true
    }
}
