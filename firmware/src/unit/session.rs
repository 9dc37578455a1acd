//! A session: one stream of samples from its start to its stop.

use bodyflight_core::link::{Ledger, StreamMode};

use crate::board::RECEIVER_BYTES;

/// The session that runs or ran last.
#[derive(Debug)]
pub(super) struct Session {
    pub(super) number: u16,
    pub(super) ledger: Ledger,
    mode: StreamMode,
    closed: bool,
    /// Credit granted last.
    granted: u32,
}

/// Longest frame of a sample.
const SAMPLE_BYTES: usize = 134;

/// Samples that may be under way: while an update runs the board's receiver must hold them. The unit works off as
/// many in two updates, so that whoever keeps to the credit is in time.
#[expect(clippy::cast_possible_truncation, reason = "a few")]
const UNDER_WAY: u32 = (RECEIVER_BYTES / SAMPLE_BYTES) as u32;

/// Credit is worth a frame from this many samples on.
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

    /// The host has sent all its samples.
    pub(super) fn close(&mut self, sent: u32) {
        if self.mode != StreamMode::Sensor {
            self.ledger.close(sent);
        }
        self.closed = true;
    }

    /// What may have been sent in all while so many samples wait, where the host should hear of it.
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
