//! The ledger, an exact account of the fate of every sample.
//!
//! Every sequence number from the first to the last one sent has exactly one fate:
//!
//! `sent == used + rejected + dropped_oldest + queued + late + damaged + lost`
//!
//! A duplicate is a second arrival of a number whose fate is already known, so it is counted with the frames, of which
//! `sent + duplicate` were carried. Damaged and lost together are the numbers that never arrived. A damaged frame does
//! not reveal its number, so as many missing numbers as there were damaged frames are counted as damaged. All sums hold
//! modulo 2^32: counters and numbers wrap together.

use core::fmt;

/// How far back from the newest number a first arrival can be distinguished from a second.
const WINDOW: u32 = u128::BITS;

/// What a sequence number shows about a sample that arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// The sample is newer than all before; `skipped` numbers in front of it are missing.
    New {
        /// How many numbers were skipped.
        skipped: u32,
    },
    /// A later sample arrived first: too late for a filter that only moves forward.
    Late,
    /// The sample arrived before.
    Duplicate,
    /// The sample is too old to be identified; its number remains missing.
    Stale,
}

/// Fates of the samples of one session, on the receiving side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ledger {
    first: u32,
    /// The next number expected.
    next: u32,
    /// Bit k is set if number `next - 1 - k` has arrived.
    arrived: u128,
    /// Count of the numbers that belong to the session, at most [`WINDOW`].
    due: u32,
    fresh: u32,
    used: u32,
    rejected: u32,
    dropped_oldest: u32,
    late: u32,
    duplicate: u32,
    stale: u32,
    missing: u32,
    gap_events: u32,
}

/// Counts of the fates, see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Account {
    /// Samples used by the filter.
    pub used: u32,
    /// Samples rejected by the estimator.
    pub rejected: u32,
    /// Samples removed from the queue in favour of newer ones.
    pub dropped_oldest: u32,
    /// Samples that arrived and are waiting.
    pub queued: u32,
    /// Samples overtaken by later ones.
    pub late: u32,
    /// Samples that never arrived and are matched by a damaged frame.
    pub damaged: u32,
    /// Samples that never arrived and left no trace.
    pub lost: u32,
}

impl Account {
    /// Returns the sum of all fates.
    pub const fn total(&self) -> u32 {
        self.used
            .wrapping_add(self.rejected)
            .wrapping_add(self.dropped_oldest)
            .wrapping_add(self.queued)
            .wrapping_add(self.late)
            .wrapping_add(self.damaged)
            .wrapping_add(self.lost)
    }
}

/// Error for fates that do not add up to the number of samples sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imbalance {
    /// Samples sent.
    pub sent: u32,
    /// The account at that time.
    pub account: Account,
}

impl fmt::Display for Imbalance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total = self.account.total();
        write!(f, "{} samples sent, {total} accounted for", self.sent)
    }
}

impl core::error::Error for Imbalance {}

impl Default for Ledger {
    fn default() -> Self {
        Self::new(0)
    }
}

impl Ledger {
    /// Creates the ledger of a session whose first sample has the number `first`.
    pub const fn new(first: u32) -> Self {
        Self {
            first,
            next: first,
            arrived: 0,
            due: 0,
            fresh: 0,
            used: 0,
            rejected: 0,
            dropped_oldest: 0,
            late: 0,
            duplicate: 0,
            stale: 0,
            missing: 0,
            gap_events: 0,
        }
    }

    /// Records the arrival of `sequence`. Only [`Arrival::New`] is passed on to the filter; its fate must then be
    /// recorded by [`Ledger::use_one`], [`Ledger::reject_one`] or [`Ledger::drop_oldest`].
    pub fn receive(&mut self, sequence: u32) -> Arrival {
        let ahead = sequence.wrapping_sub(self.next);
        if ahead.cast_signed() >= 0 {
            self.advance(ahead.wrapping_add(1));
            self.arrived |= 1;
            self.missing = self.missing.wrapping_add(ahead);
            self.fresh = self.fresh.wrapping_add(1);
            if ahead > 0 {
                self.gap_events = self.gap_events.wrapping_add(1);
            }
            return Arrival::New { skipped: ahead };
        }
        let age = self.next.wrapping_sub(sequence).wrapping_sub(1);
        if age >= self.due {
            self.stale = self.stale.wrapping_add(1);
            return Arrival::Stale;
        }
        let place = 1u128.wrapping_shl(age);
        if self.arrived & place != 0 {
            self.duplicate = self.duplicate.wrapping_add(1);
            return Arrival::Duplicate;
        }
        self.arrived |= place;
        self.missing = self.missing.wrapping_sub(1);
        self.late = self.late.wrapping_add(1);
        Arrival::Late
    }

    /// Records that the filter used a sample.
    pub fn use_one(&mut self) {
        self.used = self.used.wrapping_add(1);
    }

    /// Records that the estimator rejected a sample.
    pub fn reject_one(&mut self) {
        self.rejected = self.rejected.wrapping_add(1);
    }

    /// Records that a queued sample was dropped in favour of a newer one.
    pub fn drop_oldest(&mut self) {
        self.dropped_oldest = self.dropped_oldest.wrapping_add(1);
    }

    /// Closes the session: the source reports how many samples it sent, so any numbers after the newest are missing
    /// too.
    pub fn close(&mut self, sent: u32) {
        let tail = self.first.wrapping_add(sent).wrapping_sub(self.next);
        if tail.cast_signed() > 0 {
            self.advance(tail);
            self.missing = self.missing.wrapping_add(tail);
            self.gap_events = self.gap_events.wrapping_add(1);
        }
    }

    /// Returns the fates, given the number of damaged frames that the decoder saw in the session.
    pub fn account(&self, damaged_frames: u32) -> Account {
        let damaged = damaged_frames.min(self.missing);
        Account {
            used: self.used,
            rejected: self.rejected,
            dropped_oldest: self.dropped_oldest,
            queued: self
                .fresh
                .wrapping_sub(self.used)
                .wrapping_sub(self.rejected)
                .wrapping_sub(self.dropped_oldest),
            late: self.late,
            damaged,
            lost: self.missing.wrapping_sub(damaged),
        }
    }

    /// Returns the account of a closed session.
    ///
    /// # Errors
    /// Returns an error if the fates do not add up to `sent`: a sample was invented or the source miscounted.
    pub fn balance(&self, sent: u32, damaged_frames: u32) -> Result<Account, Imbalance> {
        let account = self.account(damaged_frames);
        // More samples waiting than ever arrived means that a fate was recorded twice.
        if account.total() == sent && account.queued <= self.fresh {
            Ok(account)
        } else {
            Err(Imbalance { sent, account })
        }
    }

    /// Number of samples of the session up to the newest that arrived, whatever their fate; wraps.
    pub const fn expected(&self) -> u32 {
        self.next.wrapping_sub(self.first)
    }

    /// Number of second arrivals.
    pub const fn duplicate(&self) -> u32 {
        self.duplicate
    }

    /// Number of arrivals too old to distinguish a first from a second.
    pub const fn stale(&self) -> u32 {
        self.stale
    }

    /// Number of samples that have not arrived.
    pub const fn missing(&self) -> u32 {
        self.missing
    }

    /// Number of times that sequence numbers were skipped.
    pub const fn gap_events(&self) -> u32 {
        self.gap_events
    }

    fn advance(&mut self, count: u32) {
        self.arrived = self.arrived.checked_shl(count).unwrap_or(0);
        self.next = self.next.wrapping_add(count);
        self.due = self.due.saturating_add(count).min(WINDOW);
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use proptest::prelude::*;
    use std::vec::Vec;

    #[test]
    fn each_kind_of_arrival_is_recognised_across_the_wrap() {
        let mut ledger = Ledger::new(u32::MAX - 1);
        assert_eq!(ledger.receive(u32::MAX - 1), Arrival::New { skipped: 0 });
        assert_eq!(ledger.receive(1), Arrival::New { skipped: 2 });
        assert_eq!(ledger.receive(0), Arrival::Late);
        assert_eq!(ledger.receive(0), Arrival::Duplicate);
        assert_eq!(ledger.receive(1), Arrival::Duplicate);
        assert_eq!(ledger.receive(u32::MAX - 2), Arrival::Stale);
        assert_eq!(ledger.receive(300), Arrival::New { skipped: 298 });
        assert_eq!(ledger.receive(100), Arrival::Stale);
        ledger.use_one();
        ledger.reject_one();
        ledger.close(305);
        let closed = ledger;
        ledger.close(305);
        assert_eq!(ledger, closed, "a repeated end changes nothing");
        let account = ledger.balance(305, 3).unwrap();
        assert_eq!((account.used, account.rejected, account.late), (1, 1, 1));
        assert_eq!((account.queued, account.damaged), (1, 3));
        assert_eq!(account.lost, 305 - 1 - 1 - 1 - 1 - 3);
        assert_eq!((ledger.duplicate(), ledger.stale()), (2, 2));
        assert!(ledger.balance(304, 3).is_err());
        ledger.use_one();
        ledger.use_one();
        assert!(ledger.balance(305, 3).is_err(), "a sample used twice");
    }

    proptest! {
        #[test]
        fn the_ledger_agrees_with_a_full_memory(
            first in any::<u32>(),
            steps in prop::collection::vec((-100i32..40, 0u8..4), 0..300),
        ) {
            let mut ledger = Ledger::new(first);
            let mut memory: Vec<u8> = Vec::new();
            let (mut newest, mut fresh, mut late, mut duplicate) = (0i32, 0u32, 0u32, 0u32);
            for (step, fate) in steps {
                let offset = (newest + step).max(0);
                let known = usize::try_from(offset).unwrap();
                let arrival = ledger.receive(first.wrapping_add(offset.cast_unsigned()));
                if memory.len() <= known {
                    memory.resize(known + 1, 0);
                    let new = matches!(arrival, Arrival::New { .. });
                    prop_assert!(new, "{:?}", arrival);
                    fresh += 1;
                    match fate {
                        0 => ledger.use_one(),
                        1 => ledger.reject_one(),
                        2 => ledger.drop_oldest(),
                        _ => {}
                    }
                } else if memory[known] == 0 {
                    prop_assert_eq!(arrival, Arrival::Late);
                    late += 1;
                } else {
                    prop_assert_eq!(arrival, Arrival::Duplicate);
                    duplicate += 1;
                }
                memory[known] = 1;
                newest = newest.max(offset);
            }
            let sent = u32::try_from(memory.len()).unwrap() + 5;
            ledger.close(sent);
            let account = ledger.balance(sent, 7);
            prop_assert!(account.is_ok(), "{:?}", account);
            let account = account.unwrap();
            prop_assert_eq!(account.lost + account.damaged, sent - fresh - late);
            prop_assert_eq!(ledger.duplicate(), duplicate);
        }
    }
}
