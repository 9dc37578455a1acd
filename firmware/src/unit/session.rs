//! A session: one stream of samples from `START` to `STOP`.

use bodyflight_core::link::{Ledger, StreamMode};

use crate::board::RECEIVER_BYTES;

/// The current or most recent session.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) number: u16,
    pub(super) ledger: Ledger,
    mode: StreamMode,
    closed: bool,
    /// Total credit granted last.
    granted: u32,
}

/// Length of a sample's frame (bytes).
const SAMPLE_BYTES: usize = 134;

/// Number of samples that may be in transit: the board's receiver must hold them during an update. The unit processes
/// as many in two updates, so a host that respects the credit is never late.
#[expect(clippy::cast_possible_truncation, reason = "only a few samples fit")]
const UNDER_WAY: u32 = (RECEIVER_BYTES / SAMPLE_BYTES) as u32;

/// Smallest increase of credit for which a frame is sent.
const WORTH: u32 = UNDER_WAY / 2;

impl Session {
    pub(super) const fn new(number: u16, mode: StreamMode) -> Self {
        Self {
            number,
            ledger: Ledger::new(0),
            mode,
            closed: false,
            granted: 0,
        }
    }

    /// Whether the session is open and in this mode.
    pub(super) fn runs(&self, mode: StreamMode) -> bool {
        self.mode == mode && !self.closed
    }

    pub(super) const fn is_closed(&self) -> bool {
        self.closed
    }

    pub(super) const fn is_open(&self) -> bool {
        !self.closed
    }

    /// Closes the session; the host has sent `sent` samples.
    pub(super) fn close(&mut self, sent: u32) {
        if self.mode != StreamMode::Sensor {
            self.ledger.close(sent);
        }
        self.closed = true;
    }

    /// Returns the total credit with `waiting` samples queued, or `None` if the host need not be told.
    pub(super) fn grant(&mut self, waiting: u32, asked: bool) -> Option<u32> {
        let free = UNDER_WAY.saturating_sub(waiting);
        let granted = self.ledger.expected().wrapping_add(free);
        let worth = asked || granted.wrapping_sub(self.granted) >= WORTH;
        if !self.runs(StreamMode::Credit) || !worth {
            return None;
        }
        self.granted = granted;
        Some(granted)
    }
}

/// Silence after which a sensor is missed (us), and after which its receiver is taken to be dead.
const MISSED: u64 = 1_000_000;
const DEAD: u64 = 3_000_000;

/// Watches whether the sensor on the unit's own port is heard.
#[derive(Debug, Clone, Copy)]
pub(super) struct Silence {
    /// Time at which it was heard last (us).
    heard: Option<u64>,
    missed: bool,
    count: u32,
}

impl Silence {
    pub(super) const fn new() -> Self {
        Self {
            heard: None,
            missed: false,
            count: 0,
        }
    }

    /// Notes a sample at `now` (us).
    pub(super) fn hear(&mut self, now: u64) {
        self.heard = Some(now);
        self.missed = false;
    }

    /// Whether the sensor was heard before and has been silent for so long that its receiver must be dead.
    pub(super) fn judge(&mut self, now: u64) -> bool {
        let Some(heard) = self.heard else {
            return false;
        };
        let silent = now.saturating_sub(heard);
        if silent >= MISSED && !self.missed {
            self.missed = true;
            self.count = self.count.wrapping_add(1);
        }
        silent >= DEAD
    }

    /// Number of silences so far; wraps.
    pub(super) const fn count(&self) -> u32 {
        self.count
    }
}
