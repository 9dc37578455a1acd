//! What the application asks of a board.

use crate::recorder::Recorder;

/// Bytes that a board's receiver should hold while an update runs.
pub const RECEIVER_BYTES: usize = 1024;

/// Bytes of the place of a panic.
pub const PLACE_BYTES: usize = 24;

/// A board under the application. Its ports are given to [`run`](crate::run()) apart.
pub trait Board {
    /// Time since the start (us).
    fn now(&self) -> u64 {
        embassy_time::Instant::now().as_micros()
    }

    /// Processor cycles, wraps.
    fn cycles(&self) -> u32;

    /// Bytes of stack that were never touched.
    fn stack_free(&self) -> u32;

    /// Overruns and other errors of the host's line since the start.
    fn line_errors(&self) -> [u32; 2];

    /// The same of the sensor's line, where there is one.
    fn sensor_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    /// Voltage of the battery (mV), 0 where none is measured.
    fn battery(&self) -> u16 {
        0
    }

    /// Switches the light on or off, where there is one; [`light`](crate::light) says what it shows.
    fn shine(&self, _on: bool) {}

    /// Tells the watchdog that the application goes on.
    fn feed_watchdog(&self);

    /// What keeps a log on board, where there is storage.
    fn recorder(&self) -> Option<&Recorder> {
        None
    }

    /// Notes which sample is in work, for the record that survives a fault.
    fn note(&self, sequence: u32);
}

/// Voltage of a battery (mV) behind a divider by so many, as a converter of 12 bits counts it at 3.3 V.
pub fn millivolts(count: u16, divider: u16) -> u16 {
    let scaled = u32::from(count) * u32::from(divider) * 3300 / 4095;
    u16::try_from(scaled).unwrap_or(u16::MAX)
}

/// Who the unit is and why it started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Identity {
    /// Build: the first bytes of the source revision, zero where unknown.
    pub build: [u8; 8],
    /// Changes at each start.
    pub boot_id: u32,
    /// Why the unit started: 0 power, 1 fault, 2 watchdog, 3 other, 4 brown-out.
    pub reset_cause: u8,
    /// Starts after a fault since power was applied.
    pub fault_resets: u16,
    /// The last fault: 0 none, else a [`Kind`](crate::fault::Kind).
    pub fault_kind: u8,
    /// Program counter at the last fault, 0 where it is not known; for a panic the address of its location.
    pub fault_address: u32,
    /// Sequence number of the sample in work at the last fault.
    pub fault_sequence: u32,
    /// End of file and line of the last fault where it was a panic.
    pub fault_place: [u8; PLACE_BYTES],
    /// Starts by the watchdog.
    pub watchdog_resets: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_is_told_in_millivolts() {
        assert_eq!(millivolts(0, 2), 0);
        // 3.7 V, halved.
        assert_eq!(millivolts(2296, 2), 3700);
        // 5 V on a USB cable, over three.
        assert_eq!(millivolts(2068, 3), 4999);
        assert_eq!(millivolts(4095, 30), u16::MAX);
    }
}
