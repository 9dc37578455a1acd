//! The stored configuration: one record in either of two sectors.
//!
//! A new record is written into the free sector, then the old one is erased. So if power fails, one of the two is there;
//! and a record that is damaged later is the only one, so that no older one is used in its place.

use core::ops::Range;

use bodyflight_core::link::{SETUP_LENGTH, Setup};
use embedded_storage_async::nor_flash::NorFlash;

use super::slots::{Content, Failed, Memory, WORD, sector_size};

/// Length of the buffer for a record (bytes).
const BUFFER: usize = SETUP_LENGTH.next_multiple_of(WORD);

/// Where the record is kept.
#[derive(Debug, Clone)]
pub(super) struct KeptSetup {
    range: Range<u32>,
}

impl KeptSetup {
    pub(super) const fn new(range: Range<u32>) -> Self {
        Self { range }
    }

    fn sectors<S: NorFlash>(&self) -> [Range<u32>; 2] {
        let start = self.range.start;
        let size = sector_size::<S>();
        [start..start + size, start + size..start + 2 * size]
    }

    /// Address and number of the newest whole record.
    async fn newest<S: NorFlash>(
        &self,
        memory: &mut Memory<S>,
        buffer: &mut [u8; BUFFER],
    ) -> Result<Option<(u32, u32)>, Failed> {
        let mut newest: Option<(u32, u32)> = None;
        for Range { start, .. } in self.sectors::<S>() {
            let Some(number) = memory.number(start).await? else {
                continue;
            };
            let content = memory.read(start, number, buffer).await;
            if matches!(content, Content::Whole(_)) && newest.is_none_or(|(_, n)| n < number) {
                newest = Some((start, number));
            }
        }
        Ok(newest)
    }

    /// Reads the record; `None` if there is none, if it is damaged or if another build wrote it.
    pub(super) async fn read<S: NorFlash>(&self, memory: &mut Memory<S>) -> Option<Setup> {
        let mut buffer = [0; BUFFER];
        let (address, number) = self.newest(memory, &mut buffer).await.ok()??;
        match memory.read(address, number, &mut buffer).await {
            Content::Whole(bytes) => Setup::decode(bytes).ok(),
            Content::Nothing | Content::Damaged(_) => None,
        }
    }

    pub(super) async fn store<S: NorFlash>(
        &self,
        memory: &mut Memory<S>,
        record: &[u8; SETUP_LENGTH],
    ) -> Result<(), Failed> {
        let mut buffer = [0; BUFFER];
        let newest = self.newest(memory, &mut buffer).await?;
        let [first, second] = self.sectors::<S>();
        let (free, old) = match newest {
            Some((address, _)) if address == first.start => (second, first),
            _ => (first, second),
        };
        let number = newest.map_or(0, |(_, number)| number.wrapping_add(1));
        memory.erase(free.clone()).await?;
        memory.write(free.start, number, record).await?;
        match memory.read(free.start, number, &mut buffer).await {
            Content::Whole(written) if written == record.as_slice() => memory.erase(old).await,
            _ => Err(Failed),
        }
    }

    pub(super) async fn erase<S: NorFlash>(&self, memory: &mut Memory<S>) -> Result<(), Failed> {
        let [first, second] = self.sectors::<S>();
        memory.erase(first.start..second.end).await
    }
}
