//! The log on board: samples and estimates of a flight, in blocks that outlive a loss of power.
//!
//! The unit notes what it computes with and what it found; [`Recorder`] packs that into blocks
//! ([`bodyflight_core::link::BlockWriter`]). From the exit to the landing they are written; before the exit the youngest are
//! kept, so that the log begins before the flight was told. Where no vertical velocity is known, everything is written.
//! A flight begins with its configuration: a log is complete by itself. [`FlightLog`](storage::FlightLog) is the task that writes and reads
//! them.

mod phase;
pub mod serial_flash;
pub mod storage;

use core::cell::RefCell;

use bodyflight_core::link::{
    BLOCK_LENGTH, BlockWriter, Header, LogAction, Message, Sample, Validity,
};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;

pub use phase::{Phase, Watch};

/// Longest time that a block takes in (us): what is lost with the power besides what is being written.
const LONGEST_BLOCK: u64 = 250_000;

/// Blocks of the configuration: 18 messages.
const PREAMBLE: usize = 3;

/// A block and its length.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    bytes: [u8; BLOCK_LENGTH],
    length: usize,
}

impl Block {
    /// Without bytes.
    pub const EMPTY: Self = Self {
        bytes: [0; BLOCK_LENGTH],
        length: 0,
    };

    /// Its bytes.
    pub fn bytes(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    fn fill(&mut self, bytes: &[u8]) {
        self.length = bytes.len().min(BLOCK_LENGTH);
        for (place, byte) in self.bytes.iter_mut().zip(bytes) {
            *place = *byte;
        }
    }
}

/// What is between the unit and its storage, see the [module](self).
pub struct Recorder {
    state: RefCell<State>,
    /// There is something to write, or to read.
    changed: Signal<NoopRawMutex, ()>,
}

/// How long a flight is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Until {
    /// To the landing.
    #[default]
    Landing,
    /// To the canopy: storage in which the way down under it would take the place of the fall.
    Canopy,
}

#[derive(Debug)]
struct State {
    watch: Watch,
    writer: BlockWriter,
    /// Time of the first message in the open block (us).
    opened: u64,
    preamble: [Block; PREAMBLE],
    /// Blocks of the preamble that are filled, and that were taken to be written.
    filled: usize,
    taken: usize,
    ring: Ring,
    recording: bool,
    until: Until,
    /// Blocks that gave way before they were written.
    lost: u32,
    asked: Option<(LogAction, u32)>,
}

/// Closed blocks; the oldest gives way.
#[derive(Debug)]
struct Ring {
    blocks: &'static mut [Block],
    oldest: usize,
    length: usize,
    /// The oldest so many are to be written.
    due: usize,
}

impl Ring {
    /// Adds a block; whether one had to give way that was to be written.
    fn push(&mut self, bytes: &[u8], is_due: bool) -> bool {
        let room = self.blocks.len();
        if room == 0 {
            return is_due;
        }
        let mut lost = false;
        if self.length == room {
            lost = self.due > 0;
            self.drop_oldest();
        }
        let place = (self.oldest + self.length) % room;
        if let Some(block) = self.blocks.get_mut(place) {
            block.fill(bytes);
        }
        self.length += 1;
        if is_due {
            self.due = self.length;
        }
        lost
    }

    fn drop_oldest(&mut self) {
        self.oldest = (self.oldest + 1) % self.blocks.len().max(1);
        self.length = self.length.saturating_sub(1);
        self.due = self.due.saturating_sub(1);
    }

    /// Takes the oldest that is to be written.
    fn take(&mut self, block: &mut Block) -> bool {
        let Some(oldest) = self.blocks.get(self.oldest).filter(|_| self.due > 0) else {
            return false;
        };
        *block = *oldest;
        self.drop_oldest();
        true
    }
}

impl Recorder {
    /// Keeps closed blocks in `blocks`: as many as are needed before the exit is told (4 s, about 40), and while the storage is
    /// busy.
    pub fn new(blocks: &'static mut [Block]) -> Self {
        let ring = Ring {
            blocks,
            oldest: 0,
            length: 0,
            due: 0,
        };
        Self {
            state: RefCell::new(State {
                watch: Watch::default(),
                writer: BlockWriter::new(),
                opened: 0,
                preamble: [Block::EMPTY; PREAMBLE],
                filled: 0,
                taken: 0,
                ring,
                recording: false,
                until: Until::Landing,
                lost: 0,
                asked: None,
            }),
            changed: Signal::new(),
        }
    }

    /// The same, for a flight that is written so long.
    #[must_use]
    pub fn until(self, until: Until) -> Self {
        self.state.borrow_mut().until = until;
        self
    }

    /// A session begins with its configuration: these messages, in this order.
    pub fn begin(&self, messages: impl IntoIterator<Item = (Header, Message)>) {
        let state = &mut *self.state.borrow_mut();
        state.finish();
        state.filled = 0;
        let mut writer = BlockWriter::new();
        for (header, message) in messages {
            if !writer.push(&header, &message) {
                state.keep_preamble(&writer);
                writer.clear();
                writer.push(&header, &message);
            }
        }
        state.keep_preamble(&writer);
        // Not to be written until the flight begins.
        state.taken = state.filled;
        state.watch = Watch::default();
        self.changed.signal(());
    }

    /// Notes a sample that was worked on, or what was found of it.
    pub fn note(&self, header: &Header, message: &Message) {
        let state = &mut *self.state.borrow_mut();
        if let Message::Sample(sample) = message {
            let phase = state.watch.update(header.time, velocity_up(sample));
            state.follow(phase);
        }
        if header.time.saturating_sub(state.opened) >= LONGEST_BLOCK {
            state.close();
        }
        if state.writer.is_empty() {
            state.opened = header.time;
        }
        if !state.writer.push(header, message) {
            state.close();
            state.opened = header.time;
            state.writer.push(header, message);
        }
        if state.is_due() {
            self.changed.signal(());
        }
    }

    /// The session ends.
    pub fn end(&self) {
        self.state.borrow_mut().finish();
        self.changed.signal(());
    }

    /// A host asks for a block, or to erase the log.
    pub fn ask(&self, action: LogAction, block: u32) {
        self.state.borrow_mut().asked = Some((action, block));
        self.changed.signal(());
    }

    /// Blocks that gave way before they were written: the storage is too slow.
    pub fn lost(&self) -> u32 {
        self.state.borrow().lost
    }

    fn count_lost(&self) {
        let lost = &mut self.state.borrow_mut().lost;
        *lost = lost.wrapping_add(1);
    }

    /// What the flight is doing.
    pub fn phase(&self) -> Phase {
        self.state.borrow().watch.phase()
    }

    /// Whether a block is to be written.
    fn is_due(&self) -> bool {
        self.state.borrow().is_due()
    }

    /// What a host asks for.
    fn asked(&self) -> Option<(LogAction, u32)> {
        self.state.borrow_mut().asked.take()
    }

    /// The next block to be written.
    fn take(&self, block: &mut Block) -> bool {
        let state = &mut *self.state.borrow_mut();
        let filled = state.preamble.get(..state.filled).unwrap_or_default();
        if let Some(next) = filled.get(state.taken) {
            *block = *next;
            state.taken += 1;
            return true;
        }
        state.ring.take(block)
    }
}

impl State {
    /// Whether there is something to be written.
    fn is_due(&self) -> bool {
        self.ring.due > 0 || self.taken < self.filled
    }

    fn keep_preamble(&mut self, writer: &BlockWriter) {
        if let Some(block) = self.preamble.get_mut(self.filled) {
            block.fill(writer.bytes());
            self.filled += 1;
        }
    }

    /// Begins and ends with the flight.
    fn follow(&mut self, phase: Phase) {
        let recording = match phase {
            Phase::Unknown | Phase::Fall => true,
            Phase::Canopy => self.until == Until::Landing,
            Phase::Ground | Phase::Climb => false,
        };
        if recording && !self.recording {
            self.taken = 0;
            // What came before goes with it.
            self.ring.due = self.ring.length;
        } else if !recording && self.recording {
            self.close();
        }
        self.recording = recording;
    }

    /// Closes the open block.
    fn close(&mut self) {
        if self.writer.is_empty() {
            return;
        }
        if self.ring.push(self.writer.bytes(), self.recording) {
            self.lost = self.lost.wrapping_add(1);
        }
        self.writer.clear();
    }

    fn finish(&mut self) {
        self.close();
        self.recording = false;
        // What was not to be written belongs to no flight.
        self.ring.length = self.ring.due;
    }
}

fn velocity_up(sample: &Sample) -> Option<f32> {
    let known = sample.valid.contains(Validity::VELOCITY);
    sample.motion().velocity.filter(|_| known).map(|v| v.up())
}

#[cfg(test)]
mod tests;
