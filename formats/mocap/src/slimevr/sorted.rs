//! Packets in the order of their numbers: a network may deliver one after others that were sent later.

use std::collections::BTreeMap;

use super::numbers::REMEMBERED;
use super::packet::Message;

/// Longest wait for a packet that others overtook (s): what a network delays comes within a tenth of a second, and gaps of a
/// quarter of one are no more followed by who reads the record.
const PATIENCE: f64 = 0.2;
/// Most packets that wait: of later ones it is not known any more which of those before are missing.
const MOST_WAITING: u64 = REMEMBERED;
/// Most messages in packets that wait: a usual one has two for each of at most sixteen sensors.
const MOST_MESSAGES: usize = 2048;

/// A packet whose turn it is.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Due {
    pub(super) number: u64,
    /// When it came (s), or the first of those that overtook it: it was sent before them.
    pub(super) time_s: f64,
    pub(super) messages: Vec<Message>,
}

/// The packets of one tracker that wait for others before them.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Sorter {
    /// Number of the last packet whose turn it was.
    last: Option<u64>,
    /// When each came (s), and what is in it.
    waiting: BTreeMap<u64, (f64, Vec<Message>)>,
    /// Messages in all of them.
    messages: usize,
    /// Packets that were not there when it was their turn.
    pub(super) missed: u64,
}

impl Sorter {
    /// Adds a packet that came at a time (s); returns whether it was in time for its turn.
    pub(super) fn push(&mut self, number: u64, time_s: f64, messages: Vec<Message>) -> bool {
        if self.last.is_some_and(|last| number <= last) {
            return false;
        }
        self.messages += messages.len();
        self.waiting.insert(number, (time_s, messages));
        true
    }

    /// The next packet whose turn it is at a time (s), if there is one.
    pub(super) fn next(&mut self, time_s: f64) -> Option<Due> {
        let number = *self.waiting.keys().next()?;
        let arrivals = self.waiting.values().map(|(arrival, _)| *arrival);
        let first_s = arrivals.fold(f64::INFINITY, f64::min);
        let before = self.last.map_or(0, |last| number - last - 1);
        let is_due = before == 0
            || time_s - first_s > PATIENCE
            || self.waiting.len() as u64 > MOST_WAITING
            || self.messages > MOST_MESSAGES;
        if !is_due {
            return None;
        }
        let (_, messages) = self.waiting.remove(&number)?;
        self.messages -= messages.len();
        self.missed += before;
        self.last = Some(number);
        Some(Due {
            number,
            time_s: first_s,
            messages,
        })
    }

    /// The numbers begin anew. Nothing waits any more.
    pub(super) fn begin_again(&mut self) {
        let missed = self.missed;
        *self = Self {
            missed,
            ..Self::default()
        };
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Pushes packets at times, and returns numbers and times of those whose turn came.
    fn turns(sorter: &mut Sorter, packets: &[(u64, f64)]) -> Vec<(u64, f64)> {
        let mut found = Vec::new();
        for (number, time) in packets {
            sorter.push(*number, *time, vec![Message::Heartbeat]);
            while let Some(due) = sorter.next(*time) {
                found.push((due.number, due.time_s));
            }
        }
        found
    }

    #[test]
    fn packets_come_in_order_and_are_as_old_as_those_that_overtook_them() {
        let mut sorter = Sorter::default();
        let packets = [(5, 0.0), (7, 0.01), (8, 0.02), (6, 0.03), (9, 0.04)];
        let expected = [(5, 0.0), (6, 0.01), (7, 0.01), (8, 0.02), (9, 0.04)];
        assert_eq!(turns(&mut sorter, &packets), expected);
        assert_eq!(sorter.missed, 0);
        // One that does not come is waited for only so long, and it is too late then.
        assert_eq!(turns(&mut sorter, &[(11, 1.0), (12, 1.1)]), []);
        let expected = [(11, 1.0), (12, 1.1), (13, 1.21)];
        assert_eq!(turns(&mut sorter, &[(13, 1.21)]), expected);
        assert_eq!(sorter.missed, 1);
        assert!(!sorter.push(10, 1.3, Vec::new()));
        sorter.begin_again();
        assert_eq!(turns(&mut sorter, &[(1, 2.0)]), [(1, 2.0)]);
        assert_eq!(sorter.missed, 1);
    }

    #[test]
    fn what_waits_is_bounded() {
        let mut sorter = Sorter::default();
        turns(&mut sorter, &[(1, 0.0)]);
        for number in 0..1000 {
            turns(&mut sorter, &[(3 + 2 * number, 0.001)]);
            assert!(sorter.waiting.len() as u64 <= MOST_WAITING);
        }
        let large = vec![Message::Heartbeat; 10 * MOST_MESSAGES];
        sorter.push(100_000, 0.002, large);
        while sorter.next(0.002).is_some() {}
        assert_eq!(sorter.messages, 0);
    }

    proptest! {
        #[test]
        fn numbers_and_times_only_rise(
            packets in prop::collection::vec((0_u64..200, 0.0_f64..0.1), 0..100),
        ) {
            let mut sorter = Sorter::default();
            let mut time = 0.0;
            let mut numbers = std::collections::BTreeSet::new();
            let packets: Vec<(u64, f64)> = packets.into_iter().filter(|(number, _)| numbers.insert(*number)).map(|(number, step)| {
                time += step;
                (number, time)
            }).collect();
            let mut found = turns(&mut sorter, &packets);
            while let Some(due) = sorter.next(f64::INFINITY) {
                found.push((due.number, due.time_s));
            }
            for pair in found.windows(2) {
                prop_assert!(pair[0].0 < pair[1].0 && pair[0].1 <= pair[1].1, "{pair:?}");
            }
        }
    }
}
