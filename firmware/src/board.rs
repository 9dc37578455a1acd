//! The interface between the application and a board.

use bodyflight_core::link::{Header, Message};

use crate::recorder::Recorder;

/// Bytes that a board's receiver should be able to buffer during an update.
pub const RECEIVER_BYTES: usize = 1024;

/// Length of the location of a panic (bytes).
pub const PLACE_BYTES: usize = 24;

/// The hardware that the application runs on. Ports are passed to [`run`](crate::run()) separately.
pub trait Board {
    /// Time since the start (us).
    fn now(&self) -> u64 {
        embassy_time::Instant::now().as_micros()
    }

    /// Processor cycles; wraps.
    fn cycles(&self) -> u32;

    /// Bytes of stack that were never used.
    fn stack_free(&self) -> u32;

    /// Number of overruns and of other errors on the host's line since the start.
    fn line_errors(&self) -> [u32; 2];

    /// Number of overruns and of other errors on the sensor's line, if there is one.
    fn sensor_errors(&self) -> [u32; 2] {
        [0; 2]
    }

    /// Sets the rate of the sensor's line (baud), if there is one. Until then it has that of an Xsens MTi.
    fn set_sensor_rate(&self, _baud: u32) {}

    /// Voltage of the battery (mV), 0 if not measured.
    fn battery(&self) -> u16 {
        0
    }

    /// Switches the light on or off, if there is one; [`light`](crate::light) defines its patterns.
    fn shine(&self, _on: bool) {}

    /// Feeds the watchdog.
    fn feed_watchdog(&self);

    /// The recorder of the on-board log; `None` without storage.
    fn recorder(&self) -> Option<&Recorder> {
        None
    }

    /// Shows every message that a log may keep: samples, readings, estimates and reports.
    fn observe(&self, _header: &Header, _message: &Message) {}

    /// Notes the sample being processed, for the fault record.
    fn note(&self, sequence: u32);
}

/// Converts a reading of a 12-bit converter with a reference of 3.3 V to the voltage of a battery (mV) behind a
/// divider.
pub fn millivolts(count: u16, divider: u16) -> u16 {
    let scaled = u32::from(count) * u32::from(divider) * 3300 / 4095;
    u16::try_from(scaled).unwrap_or(u16::MAX)
}

/// Identity of the unit and cause of its last start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Identity {
    /// Build: the first bytes of the source revision, zero if unknown.
    pub build: [u8; 8],
    /// Changes at each start.
    pub boot_id: u32,
    /// Why the unit started: 0 power, 1 fault, 2 watchdog, 3 other, 4 brown-out.
    pub reset_cause: u8,
    /// Number of starts after a fault since power was applied.
    pub fault_resets: u16,
    /// The last fault: 0 none, else a [`Kind`](crate::fault::Kind).
    pub fault_kind: u8,
    /// Program counter at the last fault, 0 if unknown; for a panic, the address of its location.
    pub fault_address: u32,
    /// Sequence number of the sample being processed at the last fault.
    pub fault_sequence: u32,
    /// End of `file:line` of the last fault if it was a panic.
    pub fault_place: [u8; PLACE_BYTES],
    /// Number of starts by the watchdog.
    pub watchdog_resets: u32,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_battery_is_reported_in_millivolts() {
        assert_eq!(millivolts(0, 2), 0);
        // 3.7 V, halved.
        assert_eq!(millivolts(2296, 2), 3700);
        // 5 V on a USB cable, over three.
        assert_eq!(millivolts(2068, 3), 4999);
        assert_eq!(millivolts(4095, 30), u16::MAX);
    }
}
