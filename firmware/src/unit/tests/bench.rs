//! A board in virtual time.

use core::cell::Cell;

use crate::board::Board;

/// A settable clock that advances slightly each time it is read.
pub(super) struct Bench {
    pub(super) now: Cell<u64>,
    pub(super) step: u64,
    pub(super) fed: Cell<u32>,
    /// Rate that was set for the sensor's line since the last look (baud).
    pub(super) rate: Cell<Option<u32>>,
}

impl Board for Bench {
    fn now(&self) -> u64 {
        self.now.replace(self.now.get() + self.step)
    }
    fn cycles(&self) -> u32 {
        7
    }
    fn stack_free(&self) -> u32 {
        1234
    }
    fn line_errors(&self) -> [u32; 2] {
        [3, 4]
    }
    fn sensor_errors(&self) -> [u32; 2] {
        [5, 6]
    }
    fn set_sensor_rate(&self, baud: u32) {
        self.rate.set(Some(baud));
    }
    fn feed_watchdog(&self) {
        self.fed.set(self.fed.get() + 1);
    }
    fn note(&self, _: u32) {}
}
