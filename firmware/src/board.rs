//! What the application asks of a board.

/// Bytes that a board's receiver should hold while an update runs.
pub const RECEIVER_BYTES: usize = 1024;

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

    /// Overruns and framing errors of the receiver since the start.
    fn line_errors(&self) -> [u32; 2];

    /// Tells the watchdog that the application goes on.
    fn feed_watchdog(&self);

    /// Notes which sample is in work, for the record that survives a fault.
    fn note(&self, sequence: u32);
}

/// Who the unit is and why it started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Identity {
    /// Build: the first bytes of the source revision, zero where unknown.
    pub build: [u8; 8],
    /// Changes at each start.
    pub boot_id: u32,
    /// Why the unit started: 0 power, 1 fault, 2 watchdog, 3 other.
    pub reset_cause: u8,
    /// Starts after a fault since power was applied.
    pub fault_resets: u16,
    /// The last fault: 0 none, 1 panic, 2 hard fault.
    pub fault_kind: u8,
    /// Program counter at the last fault, 0 for a panic.
    pub fault_address: u32,
    /// Sequence number of the sample in work at the last fault.
    pub fault_sequence: u32,
    /// Starts by the watchdog.
    pub watchdog_resets: u32,
}
