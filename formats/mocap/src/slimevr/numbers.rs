//! The numbers of a tracker's packets: what was lost, came late or twice, and when it began again.

/// Numbers before the highest that are remembered.
pub(super) const REMEMBERED: u64 = 64;
/// Step beyond which numbers began again, rather than that packets were lost: five minutes at the highest rates.
const FARTHEST: u64 = 300_000;
/// Packets in a row with numbers before those that are remembered after which numbers began again, if the tracker did not
/// introduce itself anew: a single one was only on its way for long.
const IN_A_ROW: u32 = 8;

/// How a packet follows those before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    /// Later than all before.
    Next,
    /// It was overtaken by others.
    Late,
    /// It was there before.
    Repeated,
}

/// Follows the numbers of one tracker.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Numbers {
    highest: Option<u64>,
    /// The number it began with.
    begin: u64,
    /// Bit k is set if the packet k before the highest has arrived.
    seen: u64,
    /// Packets in a row with numbers before those that are remembered.
    behind: u32,
    /// Whether the tracker introduced itself since the last packet.
    is_greeted: bool,
    /// Packets that have arrived, those that came twice once.
    pub(super) received: u64,
    /// Packets that never arrived.
    pub(super) lost: u64,
    /// Packets that came after others with higher numbers.
    pub(super) late: u64,
    /// Packets that came again.
    pub(super) repeated: u64,
    /// Times the numbers began again.
    pub(super) restarts: u64,
}

impl Numbers {
    /// The tracker introduced itself again: since it is new, or since it had lost its server, which changes no numbers.
    pub(super) fn greeted(&mut self) {
        self.is_greeted = true;
    }

    /// Takes a number; 0 is that of packets without one.
    pub(super) fn take(&mut self, number: u64) -> Order {
        if number == 0 {
            return Order::Next;
        }
        let Some(highest) = self.highest else {
            return self.first(number);
        };
        if number > highest {
            let step = number - highest;
            if step > FARTHEST {
                self.restarts += 1;
                return self.first(number);
            }
            self.lost += step - 1;
            self.received += 1;
            self.seen = match step < REMEMBERED {
                true => self.seen << step | 1,
                false => 1,
            };
            (self.highest, self.behind, self.is_greeted) = (Some(number), 0, false);
            return Order::Next;
        }
        let back = highest - number;
        if back >= REMEMBERED {
            self.behind += 1;
        }
        // A packet that was overtaken is among the last ones, and a tracker that is new begins with the first numbers.
        let is_new = self.is_greeted && (back >= REMEMBERED || highest < 2 * REMEMBERED);
        if is_new || self.behind >= IN_A_ROW {
            self.restarts += 1;
            return self.first(number);
        }
        if back >= REMEMBERED {
            self.late += 1;
            return Order::Late;
        }
        if self.seen >> back & 1 == 1 {
            self.repeated += 1;
            return Order::Repeated;
        }
        self.seen |= 1 << back;
        self.received += 1;
        self.late += 1;
        if number > self.begin {
            self.lost = self.lost.saturating_sub(1);
        }
        Order::Late
    }

    fn first(&mut self, number: u64) -> Order {
        (self.highest, self.seen, self.begin) = (Some(number), 1, number);
        (self.behind, self.is_greeted) = (0, false);
        self.received += 1;
        Order::Next
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_packet_is_lost_late_repeated_or_next() {
        let mut numbers = Numbers::default();
        let orders: Vec<Order> = [5, 6, 9, 8, 8, 0, 10, 200, 3, 4]
            .iter()
            .map(|number| numbers.take(*number))
            .collect();
        let (next, late, again) = (Order::Next, Order::Late, Order::Repeated);
        assert_eq!(
            orders,
            [next, next, next, late, again, next, next, next, late, late]
        );
        assert_eq!((numbers.lost, numbers.late), (1 + 189, 3));
        assert_eq!((numbers.repeated, numbers.restarts), (1, 0));
        assert_eq!(numbers.received, 6);
        assert_eq!(numbers.take(u64::MAX), next);
        assert_eq!(numbers.take(u64::MAX - 1), late);
        assert_eq!(numbers.restarts, 1);
        assert_eq!(
            numbers.lost, 190,
            "it precedes the first, and was never missed"
        );
    }

    #[test]
    fn a_tracker_that_begins_again_is_told_from_one_that_lost_its_server() {
        let after = |greeted: bool, highest: u64, numbers_after: &[u64]| {
            let mut numbers = Numbers::default();
            for number in 1..=highest {
                numbers.take(number);
            }
            if greeted {
                numbers.greeted();
            }
            for number in numbers_after {
                numbers.take(*number);
            }
            (numbers.restarts, numbers.lost)
        };
        // It had lost its server, and one of its packets came later than its introduction.
        assert_eq!(after(true, 1000, &[1001, 1002]), (0, 0));
        assert_eq!(after(true, 1000, &[998, 1001, 1002]), (0, 0));
        // It is new, even if it had just begun.
        assert_eq!(after(true, 1000, &[1, 2, 3]), (1, 0));
        assert_eq!(after(true, 20, &[1, 2, 3]), (1, 0));
        // Its introduction was lost: some packets in a row tell, one alone does not.
        let again: Vec<u64> = (1..20).collect();
        assert_eq!(after(false, 1000, &again), (1, 0));
        assert_eq!(after(false, 1000, &[1, 1001, 2, 1002, 3, 1003]), (0, 0));
    }
}
