//! The ledger: what became of every sample, exactly.
//!
//! Every sequence number from the first to the last sent has one fate:
//!
//! `sent == used + rejected + dropped_oldest + queued + late + damaged + lost`
//!
//! A duplicate is a second arrival of a number that has its fate already, so it stands on the side of the
//! frames: `sent + duplicate` frames were carried. Damaged and lost together are the numbers that never
//! arrived; a damaged frame does not tell its number, so as many of them as damaged frames were seen are
//! called damaged. All sums hold modulo 2^32: counters and numbers wrap together.

use core::fmt;

/// Numbers back from the newest for which a first arrival can be told from a second.
const WINDOW: u32 = u128::BITS;

/// What a sequence number says about a sample that arrived.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Arrival {
    /// Newer than all before; `skipped` numbers are missing in front of it.
    New {
        /// Missing numbers.
        skipped: u32,
    },
    /// Overtaken by a later one: too late for a filter that goes forward.
    Late,
    /// Came before.
    Duplicate,
    /// Too old to know; its number stays missing.
    Stale,
}

/// What became of the samples of one session, on the receiving side.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ledger {
    first: u32,
    /// The number expected next.
    next: u32,
    /// Bit k: number `next - 1 - k` has arrived.
    arrived: u128,
    /// Numbers that are due, at most [`WINDOW`]: older ones belong to no one.
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

/// The fates in numbers, see the [module](self).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Account {
    /// Given to the filter.
    pub used: u32,
    /// Refused by the estimator.
    pub rejected: u32,
    /// Gave way to newer ones in the queue.
    pub dropped_oldest: u32,
    /// Arrived and waiting.
    pub queued: u32,
    /// Overtaken.
    pub late: u32,
    /// Never arrived, and a damaged frame was seen for it.
    pub damaged: u32,
    /// Never arrived, without a trace.
    pub lost: u32,
}

impl Account {
    /// The sum of all fates.
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

/// The fates do not add up to what was sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Imbalance {
    /// Samples sent.
    pub sent: u32,
    /// The account as it stands.
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
    /// A session whose first sample has the number `first`.
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

    /// Books the arrival of `sequence`. Only [`Arrival::New`] goes on to the filter, and then its fate is
    /// booked by [`Ledger::use_one`], [`Ledger::reject_one`] or [`Ledger::drop_oldest`].
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

    /// The filter used a sample.
    pub fn use_one(&mut self) {
        self.used = self.used.wrapping_add(1);
    }

    /// The estimator refused a sample.
    pub fn reject_one(&mut self) {
        self.rejected = self.rejected.wrapping_add(1);
    }

    /// A queued sample gave way to a newer one.
    pub fn drop_oldest(&mut self) {
        self.dropped_oldest = self.dropped_oldest.wrapping_add(1);
    }

    /// The source says how many samples it sent: numbers after the newest are missing too.
    pub fn close(&mut self, sent: u32) {
        let tail = self.first.wrapping_add(sent).wrapping_sub(self.next);
        if tail.cast_signed() > 0 {
            self.advance(tail);
            self.missing = self.missing.wrapping_add(tail);
            self.gap_events = self.gap_events.wrapping_add(1);
        }
    }

    /// The fates, with `damaged_frames` seen by the decoder in the session.
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

    /// The account of a closed session.
    ///
    /// # Errors
    /// Returns [`Imbalance`] if the fates do not add up to `sent`: a sample was invented or the source
    /// miscounted.
    pub fn balance(&self, sent: u32, damaged_frames: u32) -> Result<Account, Imbalance> {
        let account = self.account(damaged_frames);
        // More waiting than ever arrived means a fate was booked twice.
        if account.total() == sent && account.queued <= self.fresh {
            Ok(account)
        } else {
            Err(Imbalance { sent, account })
        }
    }

    /// Samples of the session up to the newest that arrived, whatever became of them; wraps.
    pub const fn expected(&self) -> u32 {
        self.next.wrapping_sub(self.first)
    }

    /// Second arrivals.
    pub const fn duplicate(&self) -> u32 {
        self.duplicate
    }

    /// Arrivals too old to tell a first from a second.
    pub const fn stale(&self) -> u32 {
        self.stale
    }

    /// Numbers that have not arrived.
    pub const fn missing(&self) -> u32 {
        self.missing
    }

    /// Times at which numbers were skipped.
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
    fn each_kind_of_arrival_is_told_across_the_wrap() {
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
