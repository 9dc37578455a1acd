//! Reads and writes blocks, and the stored configuration, in storage that survives a loss of power.

use core::ops::Range;

use bodyflight_core::link::{BLOCK_LENGTH, LogAction, Setup, SetupAction, SetupState};
use embassy_futures::yield_now;
use embedded_storage_async::nor_flash::NorFlash;

use super::kept_setup::KeptSetup;
use super::ring::SlotRing;
use super::slots::{Content, Memory};
use super::{Block, Recorder, SetupRequest};

/// Sent in place of a block of which nothing could be read: no packet begins with this byte, so it counts as damaged.
const UNREADABLE: [u8; 1] = [0xff];

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
    /// Reads the stored configuration; `None` if there is none that this build can use.
    fn stored(&mut self) -> impl Future<Output = Option<Setup>>;

    /// Runs forever: writes blocks, and passes what was requested to `answer`.
    fn run(&mut self, answer: impl FnMut(Answer<'_>)) -> impl Future<Output = ()>;
}

/// A log without storage, which discards everything.
#[derive(Debug, Clone, Copy, Default)]
pub struct NoLog;

impl Log for NoLog {
    async fn stored(&mut self) -> Option<Setup> {
        None
    }

    async fn run(&mut self, _: impl FnMut(Answer<'_>)) {
        core::future::pending().await
    }
}

/// A log in static memory: a large one would be copied at each call.
impl<L: Log> Log for &mut L {
    async fn stored(&mut self) -> Option<Setup> {
        (**self).stored().await
    }

    async fn run(&mut self, answer: impl FnMut(Answer<'_>)) {
        (**self).run(answer).await;
    }
}

/// A log if there is storage, none otherwise.
impl<L: Log> Log for Option<L> {
    async fn stored(&mut self) -> Option<Setup> {
        match self {
            Some(log) => log.stored().await,
            None => None,
        }
    }

    async fn run(&mut self, answer: impl FnMut(Answer<'_>)) {
        match self {
            Some(log) => log.run(answer).await,
            None => NoLog.run(answer).await,
        }
    }
}

/// How much memory is erased before it is needed, since erasing takes longer than writing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct EraseAhead {
    /// Share of the log's sectors that is kept erased during a session, as its reciprocal. The log holds the rest.
    one_in: u32,
    /// Whether sectors are erased ahead also while a flight is recorded.
    in_flight: bool,
}

impl EraseAhead {
    /// A chip of its own, which can be erased in flight as well: a fifth.
    pub const OWN_CHIP: Self = Self {
        one_in: 5,
        in_flight: true,
    };

    /// The flash that holds the program, which stops while a sector is erased: half, enough for a whole flight.
    pub const PROGRAM_FLASH: Self = Self {
        one_in: 2,
        in_flight: false,
    };
}

/// Where a host reads.
#[derive(Debug, Clone, Copy)]
struct Cursor {
    /// Number of a block as the host counts, and of the slot that holds it or is the first that may.
    block: u32,
    slot: u32,
}

/// A log in a ring of slots; the oldest are overwritten. Damage in the memory costs only the blocks that it hits.
pub struct FlightLog<'a, S: NorFlash> {
    recorder: &'a Recorder,
    memory: Memory<S>,
    ring: SlotRing,
    setup: KeptSetup,
    ahead: EraseAhead,
    /// Whether the log was found in the memory.
    is_found: bool,
    cursor: Option<Cursor>,
    /// Set while a host reads, and after a sector could not be erased: nothing is erased ahead until the next block.
    is_paused: bool,
}

impl<'a, S: NorFlash> FlightLog<'a, S> {
    /// Creates the log of `recorder` in the range `log` of a memory. The configuration is stored in the range `setup` of
    /// the same memory, two sectors outside the log.
    pub const fn new(
        recorder: &'a Recorder,
        flash: S,
        log: Range<u32>,
        setup: Range<u32>,
        ahead: EraseAhead,
    ) -> Self {
        Self {
            recorder,
            memory: Memory::new(flash),
            ring: SlotRing::new(log),
            setup: KeptSetup::new(setup),
            ahead,
            is_found: false,
            cursor: None,
            is_paused: false,
        }
    }

    /// Serves a request concerning the stored configuration. A record is replaced as a whole: if power fails meanwhile,
    /// the old one stays.
    async fn keep(&mut self, (action, record): SetupRequest, answer: &mut impl FnMut(Answer<'_>)) {
        let done = match (action, record) {
            (SetupAction::Store, Some(record)) => self.setup.store(&mut self.memory, &record).await,
            (SetupAction::Erase, _) => self.setup.erase(&mut self.memory).await,
            _ => Ok(()),
        };
        let setup = self.stored().await;
        let state = match &setup {
            _ if done.is_err() => SetupState::Failed,
            Some(_) => SetupState::Present,
            None => SetupState::Absent,
        };
        let asked = setup.as_ref().filter(|_| action == SetupAction::Read);
        answer(Answer::Setup(state, asked));
    }

    /// Writes all blocks that are due.
    async fn write(&mut self) {
        let mut block = Block::EMPTY;
        while self.recorder.take(&mut block) {
            self.is_paused = false;
            if self.ring.append(&mut self.memory, &block).await.is_err() {
                self.recorder.count_lost();
            }
        }
    }

    /// Whether a sector should be erased now.
    fn is_short(&self) -> bool {
        let enough = self.ring.sectors::<S>() / self.ahead.one_in;
        let may = self.ahead.in_flight || !self.recorder.is_recording();
        self.recorder.has_begun() && may && !self.is_paused && self.ring.erased < enough
    }

    /// Reads a block of the host's count, in which the oldest is 0.
    async fn read(&mut self, block: u32, answer: &mut impl FnMut(Answer<'_>)) {
        let start = Cursor {
            block: 0,
            slot: self.ring.oldest,
        };
        let mut at = match self.cursor {
            Some(cursor) if (1..=block).contains(&cursor.block) => cursor,
            _ => start,
        };
        self.is_paused = true;
        while at.slot < self.ring.next {
            if !self.ring.holds(&mut self.memory, at.slot).await {
                at.slot += 1;
                continue;
            }
            if at.block < block {
                at.block += 1;
                at.slot += 1;
                continue;
            }
            self.cursor = Some(at);
            let mut buffer = [0; BLOCK_LENGTH];
            let content = self.ring.read(&mut self.memory, at.slot, &mut buffer);
            let bytes = match content.await {
                Content::Whole(bytes) | Content::Damaged(bytes) if !bytes.is_empty() => bytes,
                _ => &UNREADABLE,
            };
            answer(Answer::Block(block, bytes));
            return;
        }
        self.cursor = None;
        self.is_paused = false;
        answer(Answer::Block(block, &[]));
    }

    /// Erases the log; other tasks run between its sectors.
    async fn erase(&mut self) {
        let mut place = 0;
        while self.ring.erase_place(&mut self.memory, place).await {
            place += 1;
            yield_now().await;
        }
        self.cursor = None;
    }
}

impl<S: NorFlash> Log for FlightLog<'_, S> {
    async fn stored(&mut self) -> Option<Setup> {
        self.setup.read(&mut self.memory).await
    }

    async fn run(&mut self, mut answer: impl FnMut(Answer<'_>)) {
        if !self.is_found {
            self.ring.find(&mut self.memory).await;
            self.is_found = true;
        }
        loop {
            self.write().await;
            if let Some(request) = self.recorder.asked_setup() {
                self.keep(request, &mut answer).await;
            }
            match self.recorder.asked() {
                Some((LogAction::Read, block)) => self.read(block, &mut answer).await,
                Some((LogAction::Erase, block)) => {
                    self.erase().await;
                    answer(Answer::Block(block, &[]));
                }
                None if self.is_short() => {
                    self.is_paused = self.ring.erase_one(&mut self.memory).await.is_err();
                    yield_now().await;
                }
                None => self.recorder.changed.wait().await,
            }
        }
    }
}
