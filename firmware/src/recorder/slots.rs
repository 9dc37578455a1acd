//! Content in flash with a header of its own: a number, a length and checksums.
//!
//! Nothing but a slot itself says what is in it, so damage costs only the slots that it hits. A header is written after
//! its content: without one a slot was never finished, because power failed, and holds nothing.

use core::ops::Range;

use crc::{CRC_32_ISCSI, Crc, Table};
use embedded_storage_async::nor_flash::NorFlash;

/// Length of a header (bytes).
pub(super) const HEADER: usize = 16;

/// Offset of the content (bytes).
const CONTENT: u32 = 16;

/// Bytes that are written at once, a multiple of what any chip writes at once.
pub(super) const WORD: usize = 16;

/// Content of an erased byte.
const ERASED: u8 = 0xff;

/// Number of attempts to read.
const ATTEMPTS: u32 = 3;

/// Bytes read at once while looking whether a sector is erased.
const PIECE: usize = 128;

static CHECKSUM: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISCSI);

/// The checksum of some bytes, never the content of erased memory.
fn checksum(bytes: &[u8]) -> u32 {
    match CHECKSUM.checksum(bytes) {
        u32::MAX => 0,
        sum => sum,
    }
}

/// Size of a sector, the unit of erasing (bytes).
#[expect(
    clippy::cast_possible_truncation,
    reason = "flash has addresses of 32 bits"
)]
pub(super) const fn sector_size<S: NorFlash>() -> u32 {
    S::ERASE_SIZE as u32
}

/// The storage failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Failed;

/// Header of a written slot: its number, length and checksum of its content, then a checksum of these three words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Header {
    number: u32,
    length: u32,
    sum: u32,
}

impl Header {
    fn encode(self) -> [u8; HEADER] {
        let mut bytes = [0; HEADER];
        let words = [self.number, self.length, self.sum].map(u32::to_le_bytes);
        let (content, sum) = bytes.split_at_mut(HEADER - 4);
        content.copy_from_slice(words.as_flattened());
        sum.copy_from_slice(&checksum(content).to_le_bytes());
        bytes
    }
}

/// What is in a slot, by its header.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Slot {
    /// Nothing, or something that was never finished.
    Empty,
    Written(Header),
    Damaged,
}

impl Slot {
    fn decode(bytes: &[u8; HEADER]) -> Self {
        let (content, sum) = bytes.split_at(HEADER - 4);
        // The checksum is the last word to be written.
        if sum.iter().all(|byte| *byte == ERASED) {
            return Self::Empty;
        }
        let (words, _) = content.as_chunks::<4>();
        let [number, length, sum_of_content] = words else {
            return Self::Damaged;
        };
        let [number, length, found] =
            [number, length, sum_of_content].map(|word| u32::from_le_bytes(*word));
        if checksum(content).to_le_bytes() != *sum {
            return Self::Damaged;
        }
        Self::Written(Header {
            number,
            length,
            sum: found,
        })
    }
}

/// What reading a slot gives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Content<'a> {
    /// The slot was never finished.
    Nothing,
    /// What was written.
    Whole(&'a [u8]),
    /// What is left of it: nothing if its length is unknown or the memory cannot be read.
    Damaged(&'a [u8]),
}

/// Memory that is written with headers.
#[derive(Debug)]
pub(super) struct Memory<S> {
    flash: S,
}

impl<S: NorFlash> Memory<S> {
    pub(super) const fn new(flash: S) -> Self {
        Self { flash }
    }

    pub(super) async fn erase(&mut self, range: Range<u32>) -> Result<(), Failed> {
        let erased = self.flash.erase(range.start, range.end).await;
        erased.map_err(|_| Failed)
    }

    /// Whether every byte of a range, of whole slots, is erased.
    pub(super) async fn is_erased(&mut self, range: Range<u32>) -> bool {
        let mut piece = [0; PIECE];
        for address in range.step_by(piece.len()) {
            let read = self.flash.read(address, &mut piece).await;
            if read.is_err() || piece.iter().any(|byte| *byte != ERASED) {
                return false;
            }
        }
        true
    }

    async fn try_slot(&mut self, address: u32) -> Result<Slot, Failed> {
        let mut bytes = [0; HEADER];
        for _ in 0..ATTEMPTS {
            if self.flash.read(address, &mut bytes).await.is_ok() {
                return Ok(Slot::decode(&bytes));
            }
        }
        Err(Failed)
    }

    /// The slot at `address`; damaged if it cannot be read.
    pub(super) async fn slot(&mut self, address: u32) -> Slot {
        let slot = self.try_slot(address).await;
        slot.unwrap_or(Slot::Damaged)
    }

    /// Number of the slot at `address`, if it was written and its header is whole.
    pub(super) async fn number(&mut self, address: u32) -> Result<Option<u32>, Failed> {
        match self.try_slot(address).await? {
            Slot::Written(header) => Ok(Some(header.number)),
            Slot::Empty | Slot::Damaged => Ok(None),
        }
    }

    /// Writes content after its header.
    pub(super) async fn write(
        &mut self,
        address: u32,
        number: u32,
        content: &[u8],
    ) -> Result<(), Failed> {
        let header = Header {
            number,
            length: u32::try_from(content.len()).unwrap_or(u32::MAX),
            sum: checksum(content),
        };
        let (words, rest) = content.as_chunks::<WORD>();
        let mut last = [ERASED; WORD];
        for (place, byte) in last.iter_mut().zip(rest) {
            *place = *byte;
        }
        self.put(address, HEADER, words.as_flattened()).await?;
        if !rest.is_empty() {
            let whole = words.as_flattened().len();
            self.put(address, HEADER + whole, &last).await?;
        }
        self.put(address, 0, &header.encode()).await
    }

    async fn put(&mut self, address: u32, offset: usize, bytes: &[u8]) -> Result<(), Failed> {
        let offset = u32::try_from(offset).map_err(|_| Failed)?;
        let written = self.flash.write(address + offset, bytes).await;
        written.map_err(|_| Failed)
    }

    /// Reads what was written at `address` under this number; `buffer` has room for whole words.
    pub(super) async fn read<'b>(
        &mut self,
        address: u32,
        number: u32,
        buffer: &'b mut [u8],
    ) -> Content<'b> {
        let header = match self.slot(address).await {
            Slot::Empty => return Content::Nothing,
            Slot::Written(header) if header.number == number => header,
            Slot::Written(_) | Slot::Damaged => return Content::Damaged(&[]),
        };
        let length = header.length as usize;
        let Some(words) = buffer.get_mut(..length.next_multiple_of(WORD)) else {
            return Content::Damaged(&[]);
        };
        let mut is_read = false;
        for _ in 0..ATTEMPTS {
            is_read = self.flash.read(address + CONTENT, words).await.is_ok();
            let content = words.get(..length).unwrap_or_default();
            if is_read && checksum(content) == header.sum {
                break;
            }
        }
        let content = buffer.get(..length).unwrap_or_default();
        match is_read {
            true if checksum(content) == header.sum => Content::Whole(content),
            true => Content::Damaged(content),
            false => Content::Damaged(&[]),
        }
    }
}
