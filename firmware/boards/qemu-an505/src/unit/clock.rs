//! The clock of this board's processor.

/// Ticks of a millisecond: the processor runs at 20 MHz.
pub(super) const MILLISECOND: u32 = 20_000;
