//! What a unit shows of itself: its status, its light, and whether the watchdog is fed.

use bodyflight_core::link::{Status, StreamMode};

use super::state::Unit;
use crate::board::Board;

/// Time after its last message for which a host is taken to be there (us).
const ATTENDED: u64 = 10_000_000;

impl<B: Board> Unit<B> {
    /// Handles a heartbeat: feeds the watchdog unless samples are waiting and none was processed since the last
    /// heartbeat. A single such heartbeat is harmless, since the sample may just have arrived; the watchdog resets the
    /// chip after several.
    ///
    /// A sensor that was heard in this session and then fell silent gets one reset of the chip, since the receiver of its
    /// port may be stuck. After that start nothing is expected of it until it is heard again. While a host talks, for
    /// example to read the log after a flight, nothing is reset.
    pub fn feed_watchdog(&mut self) {
        let [worked, before] = self.worked;
        self.worked[1] = worked;
        let sensor = self
            .session
            .as_ref()
            .is_some_and(|s| s.runs(StreamMode::Sensor));
        let now = self.board.now();
        let attended = self
            .host_heard
            .is_some_and(|heard| now.saturating_sub(heard) < ATTENDED);
        let is_dead = self.silence.judge(now) && sensor && !attended;
        if (self.samples.is_empty() || worked != before) && !is_dead {
            self.board.feed_watchdog();
        }
    }

    /// Advances the light by one step.
    pub fn shine(&mut self) {
        let is_on = self.light.advance();
        self.board.shine(is_on);
    }

    /// Current counters and state.
    pub fn status(&self) -> Status {
        let session = self.session.as_ref();
        let ledger = session.map(|session| session.ledger).unwrap_or_default();
        let [uart_overrun, uart_framing] = self.board.line_errors();
        let [sensor_overrun, sensor_framing] = self.board.sensor_errors();
        let [sensor_restarts, receiver_solutions] = self.sensor.counts();
        Status {
            wrong_session: self.wrong_session,
            uart_overrun,
            uart_framing,
            sensor_overrun,
            sensor_framing,
            fault_place: self.identity.fault_place,
            queue_high_water: self.samples.high_water(),
            deadline_missed: self.deadline_missed,
            cycles_max: self.cycles_max,
            innovation_rejected: self.not_taken_in,
            transmit_dropped: self.outbox.dropped(),
            stack_free: self.board.stack_free(),
            watchdog_resets: self.identity.watchdog_resets,
            battery: self.board.battery(),
            estimates_bad: self.estimates_bad,
            sensor_restarts,
            receiver_solutions,
            sensor_samples: self.sensor_samples,
            sensor_silences: self.silence.count(),
            ..Status::new(self.board.now(), self.decoder.counters(), &ledger)
        }
    }
}
