//! A queue that drops its oldest item when it is full.

use heapless::Deque;

/// A queue of at most `N` items. Pushing to a full queue drops the oldest item and counts it.
#[derive(Debug)]
pub(crate) struct Queue<V, const N: usize> {
    items: Deque<V, N>,
    dropped: u32,
    high_water: u32,
}

impl<V, const N: usize> Default for Queue<V, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<V, const N: usize> Queue<V, N> {
    /// Creates an empty queue.
    pub(crate) const fn new() -> Self {
        Self {
            items: Deque::new(),
            dropped: 0,
            high_water: 0,
        }
    }

    /// Adds an item; returns the oldest one if it was dropped.
    pub(crate) fn push(&mut self, item: V) -> Option<V> {
        let oldest = if self.items.is_full() {
            self.dropped = self.dropped.wrapping_add(1);
            self.items.pop_front()
        } else {
            None
        };
        // There is room now unless `N` is 0.
        let _ = self.items.push_back(item);
        self.high_water = self.high_water.max(self.len());
        oldest
    }

    /// Removes and returns the oldest item.
    pub(crate) fn pop(&mut self) -> Option<V> {
        self.items.pop_front()
    }

    /// Removes all items; the counters are kept.
    pub(crate) fn clear(&mut self) {
        self.items.clear();
    }

    /// Number of items in the queue.
    pub(crate) fn len(&self) -> u32 {
        u32::try_from(self.items.len()).unwrap_or(u32::MAX)
    }

    /// Whether the queue is empty.
    pub(crate) fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Number of items dropped; wraps.
    pub(crate) const fn dropped(&self) -> u32 {
        self.dropped
    }

    /// Largest number of items ever in the queue.
    pub(crate) const fn high_water(&self) -> u32 {
        self.high_water
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_oldest_item_is_dropped_and_counted() {
        let mut queue = Queue::<u8, 3>::new();
        assert!(queue.is_empty());
        for (item, gave_way) in [(1, None), (2, None), (3, None), (4, Some(1)), (5, Some(2))] {
            assert_eq!(queue.push(item), gave_way);
        }
        assert_eq!(
            (queue.len(), queue.dropped(), queue.high_water()),
            (3, 2, 3)
        );
        assert_eq!(
            [queue.pop(), queue.pop(), queue.pop(), queue.pop()],
            [Some(3), Some(4), Some(5), None]
        );
        queue.push(9);
        queue.clear();
        assert!(queue.is_empty());
        assert_eq!(queue.high_water(), 3);
    }
}
