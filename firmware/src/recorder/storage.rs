//! Reads and writes blocks in storage that survives a loss of power.

use bodyflight_core::link::{BLOCK_LENGTH, LogAction};
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::CacheImpl;
use sequential_storage::queue::{QueueIterator, QueueStorage};

use super::{Block, Recorder};

/// A task that keeps a log.
pub trait Log {
    /// Runs forever: writes blocks, and passes requested ones to `answer` as block number and bytes. The bytes are
    /// empty if there is no such block.
    fn run(self, answer: impl FnMut(u32, &[u8])) -> impl Future<Output = ()>;
}

/// A log without storage, which discards everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoLog;

impl Log for NoLog {
    async fn run(self, _: impl FnMut(u32, &[u8])) {
        core::future::pending().await
    }
}

/// A log if there is storage, none otherwise.
impl<L: Log> Log for Option<L> {
    async fn run(self, answer: impl FnMut(u32, &[u8])) {
        match self {
            Some(log) => log.run(answer).await,
            None => NoLog.run(answer).await,
        }
    }
}

/// A log in a queue of blocks; the oldest are overwritten. A block that was cut short by a loss of power is ignored,
/// since its checksum is wrong.
pub struct FlightLog<'a, S: NorFlash, C: CacheImpl<()>> {
    recorder: &'a Recorder,
    storage: QueueStorage<S, C>,
}

impl<'a, S: NorFlash, C: CacheImpl<()>> FlightLog<'a, S, C> {
    /// Creates the log of `recorder` in `storage`.
    pub const fn new(recorder: &'a Recorder, storage: QueueStorage<S, C>) -> Self {
        Self { recorder, storage }
    }

    /// Writes all blocks that are due.
    async fn write(&mut self) {
        let mut block = Block::EMPTY;
        while self.recorder.take(&mut block) {
            let mut written = self.storage.push(block.bytes(), true).await;
            if matches!(written, Err(Error::Corrupted { .. })) {
                // The queue could not repair itself: give up its contents so that new blocks can be stored.
                let _ = self.storage.erase_all().await;
                written = self.storage.push(block.bytes(), true).await;
            }
            if written.is_err() {
                self.recorder.count_lost();
            }
        }
    }

    /// Reads `block`, then further blocks for as long as the host asks for them in order and nothing has to be written.
    /// Returns the request that ended this, if any.
    async fn read(
        &mut self,
        block: u32,
        answer: &mut impl FnMut(u32, &[u8]),
    ) -> Option<(LogAction, u32)> {
        let Ok(iterator) = self.storage.iter().await else {
            answer(block, &[]);
            return None;
        };
        let mut reader = Reader {
            iterator,
            buffer: [0; BLOCK_LENGTH],
            length: 0,
            next: 0,
        };
        let mut block = block;
        loop {
            answer(block, reader.seek(block).await);
            let asked = loop {
                self.recorder.changed.wait().await;
                if self.recorder.is_due() {
                    return self.recorder.asked();
                }
                if let Some(asked) = self.recorder.asked() {
                    break asked;
                }
            };
            match asked {
                (LogAction::Read, next) if next.wrapping_add(1) >= reader.next => block = next,
                other => return Some(other),
            }
        }
    }
}

/// Reads blocks in order.
struct Reader<'s, S: NorFlash, C: CacheImpl<()>> {
    iterator: QueueIterator<'s, S, C>,
    buffer: [u8; BLOCK_LENGTH],
    /// Length of the block read last.
    length: usize,
    /// Number of the following block.
    next: u32,
}

impl<S: NorFlash, C: CacheImpl<()>> Reader<'_, S, C> {
    /// Returns the bytes of a block, which must be the one read last or a later one; empty if the log ends before it.
    async fn seek(&mut self, number: u32) -> &[u8] {
        while self.next <= number {
            let read = self.iterator.next(&mut self.buffer).await;
            let Ok(Some(entry)) = read else {
                return &[];
            };
            self.length = entry.into_buf().len();
            self.next += 1;
        }
        self.buffer.get(..self.length).unwrap_or_default()
    }
}

impl<S: NorFlash, C: CacheImpl<()>> Log for FlightLog<'_, S, C> {
    async fn run(mut self, mut answer: impl FnMut(u32, &[u8])) {
        let mut asked = None;
        loop {
            self.write().await;
            asked = match asked.or_else(|| self.recorder.asked()) {
                Some((LogAction::Read, block)) => self.read(block, &mut answer).await,
                Some((LogAction::Erase, block)) => {
                    let _ = self.storage.erase_all().await;
                    answer(block, &[]);
                    None
                }
                None => {
                    self.recorder.changed.wait().await;
                    None
                }
            };
        }
    }
}
