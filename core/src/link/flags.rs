//! Bit sets in messages; an undefined bit is rejected, since it comes from another version or from noise.

use bitflags::bitflags;

use super::wire::{BadValue, Reader, Wire, Writer};

bitflags! {
    /// Conditions to check before using an [`Estimate`](super::Estimate).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub struct EstimateFlags: u16 {
        /// The measurement was fused, and predictions follow the measurements.
        const VALID = 1 << 0;
        /// The measurement was not fused.
        const NOT_TAKEN_IN = 1 << 1;
        /// Samples were missing and were bridged by the model.
        const BRIDGED = 1 << 2;
        /// The estimate came later than one update period after its sample. This concerns timing, not the filter.
        const LATE = 1 << 3;
        /// The reconstructed motion was restarted since the last estimate: at the start, after a gap, or because
        /// predictions and measurements had diverged.
        const RESTARTED = 1 << 4;
        /// Predictions miss the measurements by far more than their variance allows.
        const INCONSISTENT = 1 << 5;
        /// The filter is still settling: less than a second has passed since the start.
        const SETTLING = 1 << 6;
        /// The estimator reported a fault, see `Faults`.
        const FAULT = 1 << 7;
        /// Error bars are too small, or the filter lacks something that acts on the body.
        const DOUBTFUL = 1 << 8;
        /// Predictions do not follow the measurements: the estimate must not be used.
        const LOST = 1 << 9;
        /// Attitude and velocity are given; the paper's filters have none.
        const MOTION = 1 << 10;
        /// Samples do not arrive at the configured rate.
        const RATE = 1 << 11;
        /// Something other than the air supports the body: it stands, walks, sits, or hangs under a canopy.
        const SUPPORTED = 1 << 12;
        /// A sensor on a limb is missing, has failed or has slipped: its segment follows a rule, with the error of that.
        const LIMB = 1 << 13;
    }
}

bitflags! {
    /// Parts of a [`Sample`](super::Sample) that hold a measurement.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub struct Validity: u8 {
        /// The 15 joint rotations.
        const POSTURE = 1 << 0;
        /// The attitude of the pelvis.
        const ATTITUDE = 1 << 1;
        /// The angular velocity of the pelvis.
        const ANGULAR_VELOCITY = 1 << 2;
        /// The velocity of the pelvis.
        const VELOCITY = 1 << 3;
        /// The horizontal speed from GNSS.
        const HORIZONTAL_SPEED = 1 << 4;
    }
}

bitflags! {
    /// What [`Sensors`](super::Sensors) hold.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub struct SensorParts: u8 {
        /// The specific force.
        const SPECIFIC_FORCE = 1 << 0;
        /// The velocity of a receiver, with its accuracy and age.
        const RECEIVER = 1 << 1;
        /// The air pressure.
        const PRESSURE = 1 << 2;
        /// North has been found: the attitudes so far had another, so the motion is taken anew.
        const NORTH_FOUND = 1 << 3;
        /// The attitude is integrated from where the sensor was level.
        const LEVELLED = 1 << 4;
        /// The sensor lies or stands still: nobody is in the air.
        const STILL = 1 << 5;
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for EstimateFlags {
    fn format(&self, out: defmt::Formatter<'_>) {
        defmt::write!(out, "{=u16:b}", self.bits());
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for SensorParts {
    fn format(&self, out: defmt::Formatter<'_>) {
        defmt::write!(out, "{=u8:b}", self.bits());
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Validity {
    fn format(&self, out: defmt::Formatter<'_>) {
        defmt::write!(out, "{=u8:b}", self.bits());
    }
}

impl Wire for EstimateFlags {
    const SIZE: usize = 2;
    const KIND: &'static str = "u16: bit 0 valid, 1 not taken in, 2 bridged, 3 late, 4 restarted, \
                                5 inconsistent, 6 settling, 7 fault, 8 doubtful, 9 lost, \
                                10 motion, 11 rate, 12 supported, 13 limb";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        self.bits().put(writer)
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        Self::from_bits(u16::take(reader)?).ok_or(BadValue::OutOfRange)
    }
}

impl Wire for SensorParts {
    const SIZE: usize = 1;
    const KIND: &'static str =
        "u8: bit 0 specific force, 1 receiver, 2 pressure, 3 north found, 4 levelled, 5 still";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        self.bits().put(writer)
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        Self::from_bits(u8::take(reader)?).ok_or(BadValue::OutOfRange)
    }
}

impl Wire for Validity {
    const SIZE: usize = 1;
    const KIND: &'static str =
        "u8: bit 0 posture, 1 attitude, 2 angular velocity, 3 velocity, 4 horizontal speed";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        self.bits().put(writer)
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        Self::from_bits(u8::take(reader)?).ok_or(BadValue::OutOfRange)
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::format;

    /// Asserts that the byte table names every bit, and returns the number of bits.
    fn named_bits<F: bitflags::Flags<Bits: Into<u64>>>(kind: &str) -> usize {
        for flag in F::FLAGS {
            let bits: u64 = flag.value().bits().into();
            let name = flag.name().to_lowercase().replace('_', " ");
            let row = format!("{} {name}", bits.trailing_zeros());
            assert!(kind.contains(&row), "{kind}: {row}");
        }
        F::FLAGS.len()
    }

    #[test]
    fn the_byte_table_names_every_bit() {
        assert_eq!(named_bits::<EstimateFlags>(EstimateFlags::KIND), 14);
        assert_eq!(named_bits::<SensorParts>(SensorParts::KIND), 6);
        assert_eq!(named_bits::<Validity>(Validity::KIND), 5);
    }

    #[test]
    fn every_set_of_known_bits_and_no_other_survives_the_round_trip() {
        for bits in 0..=u16::MAX {
            let read = EstimateFlags::take(&mut Reader::new(&bits.to_le_bytes()));
            if bits < 1 << 14 {
                let mut bytes = [0; 2];
                read.unwrap().put(&mut Writer::new(&mut bytes)).unwrap();
                assert_eq!(u16::from_le_bytes(bytes), bits);
            } else {
                assert_eq!(read, Err(BadValue::OutOfRange));
            }
        }
        for bits in 0..=u8::MAX {
            let read = Validity::take(&mut Reader::new(&[bits]));
            if bits < 1 << 5 {
                assert_eq!(read.unwrap().bits(), bits);
            } else {
                assert_eq!(read, Err(BadValue::OutOfRange));
            }
        }
    }
}
