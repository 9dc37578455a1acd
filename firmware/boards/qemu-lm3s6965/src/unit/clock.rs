//! The clock of this board's processor.

/// Ticks of a millisecond: the processor runs at 12.5 MHz.
pub(super) const MILLISECOND: u32 = 12_500;
