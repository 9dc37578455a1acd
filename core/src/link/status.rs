//! The status report sent once a second, filled from the counters of the link, and which estimates may be sent.

use super::decoder::Counters;
use super::ledger::Ledger;
use super::message::{Estimate, Status};

impl Status {
    /// Fills in the counts of decoder and ledger up to `uptime` (us); the rest is 0, to be filled in by the caller.
    pub fn new(uptime: u64, counters: &Counters, ledger: &Ledger) -> Self {
        let account = ledger.account(counters.damaged());
        Self {
            uptime,
            received_bytes: counters.bytes,
            received_frames: counters.frames,
            crc_bad: counters.crc_bad,
            cobs_bad: counters.cobs_bad,
            too_long: counters.too_long,
            unknown: counters
                .wrong_version
                .wrapping_add(counters.unknown_type)
                .wrapping_add(counters.wrong_length),
            value_bad: counters.not_finite.wrapping_add(counters.out_of_range),
            duplicate: ledger.duplicate(),
            late: account.late,
            gap_events: ledger.gap_events(),
            missing: ledger.missing(),
            used: account.used,
            rejected: account.rejected,
            dropped_oldest: account.dropped_oldest,
            wrong_session: 0,
            uart_overrun: 0,
            uart_framing: 0,
            queue_high_water: 0,
            deadline_missed: 0,
            cycles_max: 0,
            innovation_rejected: 0,
            transmit_dropped: 0,
            stack_free: 0,
            watchdog_resets: 0,
            sensor_overrun: 0,
            sensor_framing: 0,
            fault_place: [0; 24],
            battery: 0,
            estimates_bad: 0,
            sensor_restarts: 0,
            sensor_samples: 0,
            receiver_solutions: 0,
            sensor_silences: 0,
        }
    }

    /// Number of samples whose fate the unit knows.
    pub const fn accounted(&self) -> u32 {
        self.used
            .wrapping_add(self.rejected)
            .wrapping_add(self.dropped_oldest)
            .wrapping_add(self.late)
            .wrapping_add(self.missing)
    }
}

impl Estimate {
    /// Returns whether every number is finite and in the range of its field. A receiver refuses any other estimate, so
    /// the unit counts it instead of sending it.
    pub fn is_sendable(&self) -> bool {
        let ranged = self.variance.iter().chain([&self.nis]);
        let free = self.state.iter().chain(&self.measurement);
        free.chain(&self.velocity).all(|value| value.is_finite())
            && ranged
                .into_iter()
                .all(|value| (0.0..=1.0e30).contains(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_has_its_place() {
        let counters = Counters {
            bytes: 1000,
            frames: 20,
            crc_bad: 1,
            cobs_bad: 2,
            too_long: 3,
            wrong_version: 10,
            unknown_type: 20,
            wrong_length: 30,
            not_finite: 4,
            out_of_range: 5,
        };
        let mut ledger = Ledger::new(0);
        for sequence in [0, 3, 2, 2, 4] {
            ledger.receive(sequence);
        }
        ledger.use_one();
        ledger.reject_one();
        ledger.drop_oldest();
        let status = Status::new(7, &counters, &ledger);
        assert_eq!(
            (status.uptime, status.received_bytes, status.received_frames),
            (7, 1000, 20)
        );
        assert_eq!(
            (status.crc_bad, status.cobs_bad, status.too_long),
            (1, 2, 3)
        );
        assert_eq!((status.unknown, status.value_bad), (60, 9));
        assert_eq!(
            (status.used, status.rejected, status.dropped_oldest),
            (1, 1, 1)
        );
        assert_eq!((status.late, status.duplicate), (1, 1));
        assert_eq!((status.missing, status.gap_events), (1, 1));
        assert_eq!(status.accounted(), 5);
    }
}
