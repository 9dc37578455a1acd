//! What a unit knows, and how it is created.

use core::cell::RefCell;
use core::mem::MaybeUninit;

use bodyflight_core::link::{
    Configure, Decoder, Header, HelloAcknowledge, MAX_FRAME_LENGTH, Message, SCHEMA_HASH, Sample,
    SegmentErrors, SegmentTable, Sensors,
};

use super::outbox::Outbox;
use super::session::{Session, Silence};
use crate::board::{Board, Identity};
use crate::computer::Computer;
use crate::light::Light;
use crate::limbs::Limbs;
use crate::queue::Queue;
use crate::sensor::Sensor;

/// Capacity of the sample queue; in paced mode the oldest sample is dropped when it is full.
pub const SAMPLES: u16 = 32;

/// A queued sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Waiting {
    pub(super) header: Header,
    pub(super) sample: Sample,
    /// What the sensor on the unit's own port measured besides.
    pub(super) sensors: Option<Sensors>,
    /// Errors of the posture from here on, if they have changed.
    pub(super) errors: Option<SegmentErrors>,
    /// Arrival time (us), by the board's clock.
    pub(super) arrived: u64,
}

/// The unit: the protocol, the queue of samples and the filter, without ports.
#[derive(Debug)]
pub struct Unit<B: Board> {
    pub(super) board: B,
    pub(super) identity: Identity,
    /// Whether a host with the same schema hash has sent `HELLO`; until then all other messages are ignored.
    pub(super) greeted: bool,
    /// Time of the host's last message (us).
    pub(super) host_heard: Option<u64>,
    pub(super) decoder: Decoder,
    pub(super) table: SegmentTable,
    pub(super) asked: Option<Configure>,
    pub(super) session: Option<Session>,
    pub(super) sensor: Sensor,
    pub(super) samples: Queue<Waiting, { SAMPLES as usize }>,
    pub(super) outbox: Outbox,
    pub(super) computer: Computer,
    pub(super) light: Light,
    pub(super) last: Option<(Header, Sample)>,
    pub(super) wrong_session: u32,
    pub(super) deadline_missed: u32,
    pub(super) cycles_max: u32,
    pub(super) not_taken_in: u32,
    pub(super) estimates_bad: u32,
    pub(super) sensor_samples: u32,
    pub(super) silence: Silence,
    /// Number of samples processed so far, and up to the last heartbeat.
    pub(super) worked: [u32; 2],
}

impl<B: Board> Unit<B> {
    /// Creates a unit that waits for a host. Inlined so that the unit, which consists mostly of empty buffers, is built
    /// in place rather than copied.
    #[inline(always)]
    pub fn new(board: B, identity: Identity) -> Self {
        Self {
            board,
            identity,
            greeted: false,
            host_heard: None,
            decoder: Decoder::new(),
            table: SegmentTable::new(),
            asked: None,
            session: None,
            sensor: Sensor::new(),
            samples: Queue::new(),
            outbox: Outbox::new(),
            computer: Computer::new(),
            light: Light::new(matches!(identity.reset_cause, 1 | 2)),
            last: None,
            wrong_session: 0,
            deadline_missed: 0,
            cycles_max: 0,
            not_taken_in: 0,
            estimates_bad: 0,
            sensor_samples: 0,
            silence: Silence::new(),
            worked: [0; 2],
        }
    }

    /// Creates a unit in static memory. A function of its own, never inlined: a unit fills most of a board's stack, and
    /// what its caller keeps there stays below everything that runs afterwards.
    #[inline(never)]
    pub fn new_in(
        place: &'static mut MaybeUninit<RefCell<Self>>,
        board: B,
        identity: Identity,
    ) -> &'static RefCell<Self> {
        place.write(RefCell::new(Self::new(board, identity)))
    }

    /// The board that the unit runs on.
    pub fn board(&self) -> &B {
        &self.board
    }

    /// The sensors on the limbs.
    pub fn limbs(&self) -> &Limbs {
        self.sensor.limbs()
    }

    /// The computation.
    pub fn computer(&self) -> &Computer {
        &self.computer
    }

    /// The sample that was processed last, or `None` before the first.
    pub fn last_sample(&self) -> Option<&Sample> {
        self.last.as_ref().map(|(_, sample)| sample)
    }

    /// Queues a message with `time` (us) in its header.
    pub(super) fn send(&mut self, time: u64, message: impl Into<Message>) {
        let session = self.session.as_ref().map_or(0, |session| session.number);
        self.outbox.push(session, time, message.into());
    }

    pub(super) fn introduction(&self) -> HelloAcknowledge {
        let identity = self.identity;
        HelloAcknowledge {
            schema_hash: SCHEMA_HASH,
            build: identity.build,
            core_version: bodyflight_core::VERSION,
            boot_id: identity.boot_id,
            max_frame_length: u16::try_from(MAX_FRAME_LENGTH).unwrap_or(u16::MAX),
            queue_length: SAMPLES,
            reset_cause: identity.reset_cause,
            fault_resets: identity.fault_resets,
            fault_kind: identity.fault_kind,
            fault_address: identity.fault_address,
            fault_sequence: identity.fault_sequence,
        }
    }
}
