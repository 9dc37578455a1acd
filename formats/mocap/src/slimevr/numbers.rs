//! The numbers of a tracker's packets: what was lost, came late or twice, and when it began again.

/// Numbers before the highest that are remembered.
const REMEMBERED: u64 = 64;
/// Step beyond which numbers began again, rather than that packets were lost: five minutes at the highest rates.
const FARTHEST: u64 = 300_000;

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
    /// The tracker introduced itself again: its numbers may begin anew.
    pub(super) fn begin_again(&mut self) {
        self.highest = None;
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
            self.highest = Some(number);
            return Order::Next;
        }
        let back = highest - number;
        if back >= REMEMBERED {
            self.restarts += 1;
            return self.first(number);
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
            [next, next, next, late, again, next, next, next, next, next]
        );
        assert_eq!((numbers.lost, numbers.late), (1 + 189, 1));
        assert_eq!((numbers.repeated, numbers.restarts), (1, 1));
        assert_eq!(numbers.received, 8);
        numbers.begin_again();
        assert_eq!(numbers.take(1), next);
        assert_eq!(numbers.lost, 190, "a new beginning loses nothing");
        assert_eq!(numbers.take(u64::MAX), next);
        assert_eq!(numbers.take(u64::MAX - 1), late);
        assert_eq!(numbers.restarts, 2);
        assert_eq!(
            numbers.lost, 190,
            "it precedes the first, and was never missed"
        );
    }
}
