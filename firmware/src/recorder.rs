//! The on-board log: samples and estimates of a flight, in blocks that survive a loss of power.
//!
//! The unit records its configuration, inputs and results; [`Recorder`] packs them into blocks
//! ([`bodyflight_core::link::BlockWriter`]). Blocks are written to storage from the exit to the landing. Before the
//! exit the most recent blocks are kept in memory, so that the log begins before the exit was detected. The phase of the
//! jump is told by the vertical velocity, measured or of a barometer, or else by load and rest; a flight whose phase is
//! unknown is written. Each flight begins with its configuration, so a log is self-contained.
//! [`FlightLog`](storage::FlightLog) is the task that reads and writes storage.

mod kept_setup;
mod phase;
mod ring;
pub mod serial_flash;
mod slots;
pub mod storage;

use core::cell::RefCell;

use bodyflight_core::link::{
    BLOCK_LENGTH, BlockWriter, Header, LogAction, Message, SETUP_LENGTH, Sample, SetupAction,
    Validity,
};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;

use crate::sensor::STANDARD_GRAVITY;
pub use phase::{Phase, Watch};

/// Longest time that a block covers (us). This much may be lost with the power, in addition to the block being written.
const LONGEST_BLOCK: u64 = 250_000;

/// Number of blocks that hold the configuration, which is 18 messages.
const PREAMBLE: usize = 3;

/// A block of packed messages.
#[derive(Debug, Clone, Copy)]
pub struct Block {
    bytes: [u8; BLOCK_LENGTH],
    length: usize,
}

impl Block {
    /// An empty block.
    pub const EMPTY: Self = Self {
        bytes: [0; BLOCK_LENGTH],
        length: 0,
    };

    /// The bytes in use.
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

/// Buffers the log between the unit and its storage; see the [module documentation](self).
pub struct Recorder {
    state: RefCell<State>,
    /// Set when there may be something to write or read.
    changed: Signal<NoopRawMutex, ()>,
}

/// Phase of the flight at which logging ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Until {
    /// Log until landing.
    #[default]
    Landing,
    /// Log until the canopy opens, for small storage in which the canopy ride would overwrite the fall.
    Canopy,
}

#[derive(Debug)]
struct State {
    watch: Watch,
    writer: BlockWriter,
    /// Time of the first message in the open block (us).
    opened: u64,
    preamble: [Block; PREAMBLE],
    /// Number of preamble blocks that are filled, and number of these that are already being written.
    filled: usize,
    taken: usize,
    ring: Ring,
    recording: bool,
    until: Until,
    /// Number of blocks dropped before they were written.
    lost: u32,
    asked: Option<(LogAction, u32)>,
    setup: Option<SetupRequest>,
}

/// A request concerning the stored configuration, with the record to store.
pub(crate) type SetupRequest = (SetupAction, Option<[u8; SETUP_LENGTH]>);

/// Ring buffer of closed blocks; the oldest is dropped when it is full.
#[derive(Debug)]
struct Ring {
    blocks: &'static mut [Block],
    oldest: usize,
    length: usize,
    /// Number of blocks to be written, counted from the oldest.
    due: usize,
}

impl Ring {
    /// Adds a block. Returns whether a block was dropped that should have been written.
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

    /// Marks all blocks to be written. Makes room for the next one, which may close before the first is taken.
    fn mark_all(&mut self) {
        if self.length == self.blocks.len() {
            self.drop_oldest();
        }
        self.due = self.length;
    }

    fn drop_oldest(&mut self) {
        self.oldest = (self.oldest + 1) % self.blocks.len().max(1);
        self.length = self.length.saturating_sub(1);
        self.due = self.due.saturating_sub(1);
    }

    /// Moves the oldest block to be written into `block`; returns `false` if there is none.
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
    /// Creates a recorder that buffers closed blocks in `blocks`. They must cover the time until the exit is detected
    /// (4 s, about 40 blocks) and the time for which the storage is busy.
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
                setup: None,
            }),
            changed: Signal::new(),
        }
    }

    /// Sets the phase at which logging ends.
    #[must_use]
    pub fn until(self, until: Until) -> Self {
        self.state.borrow_mut().until = until;
        self
    }

    /// Begins a session with the messages of its configuration, in this order.
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
        // Marked as taken, so that they are written only when a flight begins.
        state.taken = state.filled;
        state.watch = Watch::default();
        self.changed.signal(());
    }

    /// Records a processed sample or a result for it.
    pub fn note(&self, header: &Header, message: &Message) {
        let state = &mut *self.state.borrow_mut();
        if let Message::Sample(sample) = message {
            let phase = state
                .watch
                .update(header.time, velocity_up(sample), turn(sample));
            state.follow(phase);
        }
        if let Message::Sensors(sensors) = message {
            state
                .watch
                .see_height(header.time, sensors.pressure_height());
            let force = sensors.specific_force();
            let load = force.map(|force| force.force.norm() / STANDARD_GRAVITY);
            state.watch.see_load(header.time, load);
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

    /// Ends the session.
    pub fn end(&self) {
        self.state.borrow_mut().finish();
        self.changed.signal(());
    }

    /// Queues a host's request to read a block or erase the log.
    pub fn ask(&self, action: LogAction, block: u32) {
        self.state.borrow_mut().asked = Some((action, block));
        self.changed.signal(());
    }

    /// Queues a request concerning the stored configuration in place of the one that waits. One to read never replaces
    /// another: the host asks again.
    pub fn ask_setup(&self, action: SetupAction, record: Option<[u8; SETUP_LENGTH]>) {
        let waiting = &mut self.state.borrow_mut().setup;
        if action != SetupAction::Read || waiting.is_none() {
            *waiting = Some((action, record));
        }
        self.changed.signal(());
    }

    /// Takes the pending request concerning the stored configuration.
    fn asked_setup(&self) -> Option<SetupRequest> {
        self.state.borrow_mut().setup.take()
    }

    /// Whether a session has begun since power was applied.
    fn has_begun(&self) -> bool {
        self.state.borrow().filled > 0
    }

    /// Whether a flight is being recorded.
    fn is_recording(&self) -> bool {
        self.state.borrow().recording
    }

    /// Number of blocks dropped before they were written, because the storage was too slow; wraps.
    pub fn lost(&self) -> u32 {
        self.state.borrow().lost
    }

    fn count_lost(&self) {
        let lost = &mut self.state.borrow_mut().lost;
        *lost = lost.wrapping_add(1);
    }

    /// Current phase of the jump.
    pub fn phase(&self) -> Phase {
        self.state.borrow().watch.phase()
    }

    /// Takes the host's pending request.
    fn asked(&self) -> Option<(LogAction, u32)> {
        self.state.borrow_mut().asked.take()
    }

    /// Moves the next block to be written into `block`; returns `false` if there is none.
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
    /// Whether there is a block to write.
    fn is_due(&self) -> bool {
        self.ring.due > 0 || self.taken < self.filled
    }

    fn keep_preamble(&mut self, writer: &BlockWriter) {
        if let Some(block) = self.preamble.get_mut(self.filled) {
            block.fill(writer.bytes());
            self.filled += 1;
        }
    }

    /// Starts and stops recording with the phase of the jump.
    fn follow(&mut self, phase: Phase) {
        let recording = match phase {
            // Until then, as before an exit, the latest blocks are kept in memory.
            Phase::Unknown => self.watch.is_lastingly_unknown(),
            Phase::Fall => true,
            Phase::Canopy => self.until == Until::Landing,
            Phase::Ground | Phase::Climb => false,
        };
        self.record(recording);
    }

    /// Starts or stops recording.
    fn record(&mut self, recording: bool) {
        if recording && !self.recording {
            self.taken = 0;
            // The blocks kept from before the exit are written too.
            self.ring.mark_all();
        } else if !recording && self.recording {
            self.close();
        }
        self.recording = recording;
    }

    /// Closes the open block and adds it to the ring.
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
        // Too short to tell a flight from the wait for a receiver: better written.
        if self.watch.phase() == Phase::Unknown && !self.recording {
            self.record(true);
        }
        self.close();
        self.recording = false;
        // Blocks not marked for writing belong to no flight.
        self.ring.length = self.ring.due;
    }
}

fn velocity_up(sample: &Sample) -> Option<f32> {
    let known = sample.valid.contains(Validity::VELOCITY);
    sample.motion().velocity.filter(|_| known).map(|v| v.up())
}

fn turn(sample: &Sample) -> Option<f32> {
    let known = sample.valid.contains(Validity::ANGULAR_VELOCITY);
    let turn = sample.motion().angular_velocity.filter(|_| known);
    turn.map(|turn| turn.norm())
}

#[cfg(test)]
mod tests;
