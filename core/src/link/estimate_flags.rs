//! What is to be known of an estimate before it is used.

use super::wire::{BadValue, Reader, Wire, Writer};

/// Bits of an [`Estimate`](super::Estimate).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct EstimateFlags(u16);

impl EstimateFlags {
    /// Nothing to say.
    pub const NONE: Self = Self(0);
    /// The measurement was taken in and predictions follow the measurements.
    pub const VALID: Self = Self(1 << 0);
    /// The measurement was not taken in.
    pub const NOT_TAKEN_IN: Self = Self(1 << 1);
    /// Samples were missing; the model bridged them.
    pub const BRIDGED: Self = Self(1 << 2);
    /// Later than one period of the updates after its sample. Tells of time, not of the filter.
    pub const LATE: Self = Self(1 << 3);
    /// The reconstructed motion began anew since the last estimate: at the start, after a gap, or where
    /// predictions and measurements had parted.
    pub const RESTARTED: Self = Self(1 << 4);
    /// Predictions miss the measurements by far.
    pub const INCONSISTENT: Self = Self(1 << 5);
    /// Still settling: less than a second since the start.
    pub const SETTLING: Self = Self(1 << 6);
    /// The estimator met a fault, see `Faults`.
    pub const FAULT: Self = Self(1 << 7);

    const ALL: u16 = 0xFF;

    /// Whether all bits of `flags` are set.
    pub const fn contains(self, flags: Self) -> bool {
        self.0 & flags.0 == flags.0
    }

    /// With the bits of `flags` set, if `set`.
    #[must_use]
    pub const fn with(self, flags: Self, set: bool) -> Self {
        if set { Self(self.0 | flags.0) } else { self }
    }

    /// Without the bits of `flags`.
    #[must_use]
    pub const fn without(self, flags: Self) -> Self {
        Self(self.0 & !flags.0)
    }

    /// The bits, bit 0 for valid.
    pub const fn bits(self) -> u16 {
        self.0
    }
}

impl Wire for EstimateFlags {
    const SIZE: usize = 2;
    const KIND: &'static str = "u16: bit 0 valid, 1 not taken in, 2 bridged, 3 late, 4 restarted, \
                                5 inconsistent, 6 settling, 7 fault";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(self.0.to_le_bytes())
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        let bits = u16::from_le_bytes(reader.take());
        if bits & !Self::ALL == 0 {
            Ok(Self(bits))
        } else {
            Err(BadValue::OutOfRange)
        }
    }
}
