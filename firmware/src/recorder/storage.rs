//! Reads and writes blocks, and the stored configuration, in storage that survives a loss of power.

use core::ops::Range;

use bodyflight_core::link::{
    BLOCK_LENGTH, LogAction, SETUP_LENGTH, Setup, SetupAction, SetupState,
};
use embedded_storage_async::nor_flash::NorFlash;
use sequential_storage::Error;
use sequential_storage::cache::{Cache, CacheImpl};
use sequential_storage::map::{MapConfig, MapStorage};
use sequential_storage::queue::{QueueIterator, QueueStorage};

use super::{Block, Recorder, SetupRequest};

/// Key of the configuration in its part of the storage.
const SETUP_KEY: u8 = 0;

/// Length of the buffer for the configuration with its key, rounded up to whole words (bytes).
const SETUP_BUFFER: usize = SETUP_LENGTH + 32;

/// What the storage has for the host.
#[derive(Debug, Clone, Copy)]
pub enum Answer<'a> {
    /// A block: its number and bytes, which are empty if there is no such block.
    Block(u32, &'a [u8]),
    /// State of the stored configuration, and the configuration if it was asked for.
    Setup(SetupState, Option<&'a Setup>),
}

/// A task that keeps a log.
pub trait Log {
    /// Runs forever: writes blocks, and passes what was requested to `answer`.
    fn run(&mut self, answer: impl FnMut(Answer<'_>)) -> impl Future<Output = ()>;
}

/// A log without storage, which discards everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoLog;

impl Log for NoLog {
    async fn run(&mut self, _: impl FnMut(Answer<'_>)) {
        core::future::pending().await
    }
}

/// A log in static memory: a large one would be copied at each call.
impl<L: Log> Log for &mut L {
    async fn run(&mut self, answer: impl FnMut(Answer<'_>)) {
        (**self).run(answer).await;
    }
}

/// A log if there is storage, none otherwise.
impl<L: Log> Log for Option<L> {
    async fn run(&mut self, answer: impl FnMut(Answer<'_>)) {
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
    /// Where the configuration is stored.
    setup: Range<u32>,
}

impl<'a, S: NorFlash, C: CacheImpl<()>> FlightLog<'a, S, C> {
    /// Creates the log of `recorder` in `storage`. The configuration is stored in the range `setup` of the same memory,
    /// at least two sectors outside the queue.
    pub const fn new(
        recorder: &'a Recorder,
        storage: QueueStorage<S, C>,
        setup: Range<u32>,
    ) -> Self {
        Self {
            recorder,
            storage,
            setup,
        }
    }

    /// Reads the stored configuration; `None` if there is none that this build can use.
    pub async fn setup(&mut self) -> Option<Setup> {
        let mut buffer = [0; SETUP_BUFFER];
        let config = MapConfig::try_new(self.setup.clone()).ok()?;
        let mut map = MapStorage::new(self.storage.flash(), config, Cache::new_uncached());
        let bytes: &[u8] = map.fetch_item(&mut buffer, &SETUP_KEY).await.ok()??;
        Setup::decode(bytes).ok()
    }

    /// Serves a request concerning the stored configuration. A record is replaced as a whole: if power fails meanwhile,
    /// the old one stays.
    async fn keep(&mut self, (action, record): SetupRequest, answer: &mut impl FnMut(Answer<'_>)) {
        let done = match (action, record) {
            (SetupAction::Store, Some(record)) => self.store(&record).await,
            (SetupAction::Erase, _) => {
                let Range { start, end } = self.setup.clone();
                self.storage.flash().erase(start, end).await.is_ok()
            }
            _ => true,
        };
        let setup = self.setup().await;
        let state = match &setup {
            _ if !done => SetupState::Failed,
            Some(_) => SetupState::Present,
            None => SetupState::Absent,
        };
        let asked = setup.as_ref().filter(|_| action == SetupAction::Read);
        answer(Answer::Setup(state, asked));
    }

    async fn store(&mut self, record: &[u8]) -> bool {
        let mut buffer = [0; SETUP_BUFFER];
        let range = self.setup.clone();
        let Ok(config) = MapConfig::try_new(range.clone()) else {
            return false;
        };
        let mut map = MapStorage::new(self.storage.flash(), config, Cache::new_uncached());
        let mut stored = map.store_item(&mut buffer, &SETUP_KEY, &record).await;
        if matches!(stored, Err(Error::Corrupted { .. })) {
            let _ = map.erase_all().await;
            stored = map.store_item(&mut buffer, &SETUP_KEY, &record).await;
        }
        stored.is_ok()
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
        answer: &mut impl FnMut(Answer<'_>),
    ) -> Option<(LogAction, u32)> {
        let Ok(iterator) = self.storage.iter().await else {
            answer(Answer::Block(block, &[]));
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
            answer(Answer::Block(block, reader.seek(block).await));
            let asked = loop {
                self.recorder.changed.wait().await;
                if self.recorder.is_due() || self.recorder.has_setup_request() {
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
    async fn run(&mut self, mut answer: impl FnMut(Answer<'_>)) {
        let mut asked = None;
        loop {
            self.write().await;
            if let Some(request) = self.recorder.asked_setup() {
                self.keep(request, &mut answer).await;
            }
            asked = match asked.or_else(|| self.recorder.asked()) {
                Some((LogAction::Read, block)) => self.read(block, &mut answer).await,
                Some((LogAction::Erase, block)) => {
                    let _ = self.storage.erase_all().await;
                    answer(Answer::Block(block, &[]));
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
