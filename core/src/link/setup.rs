//! The configuration as it is stored on a unit: one record with a version and a checksum.
//!
//! The version is the hash of the message table, so a record that another build wrote is refused rather than misread.

use core::fmt;

use super::calibration::{LIMBS, LimbSensor, LimbTable};
use super::frame::checksum;
use super::message::{Configure, SegmentValues};
use super::schema::SCHEMA_HASH;
use super::segment_values::SegmentTable;
use super::wire::{Body as _, Reader, Writer};
use crate::body::SEGMENT_COUNT;

const CONTENT: usize = 8
    + <Configure as super::wire::Body>::SIZE
    + SEGMENT_COUNT * <SegmentValues as super::wire::Body>::SIZE
    + LIMBS * (1 + <LimbSensor as super::wire::Body>::SIZE);

/// Length of a stored configuration (bytes).
pub const SETUP_LENGTH: usize = CONTENT + 4;

/// A configuration with its segment table and the sensors on the limbs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Setup {
    /// The configuration.
    pub configure: Configure,
    /// The segment table that it refers to.
    pub table: SegmentTable,
    /// The sensors on the limbs, if they are calibrated.
    pub limbs: LimbTable,
}

/// Why a stored configuration is not usable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum SetupError {
    /// It has another length, or its checksum differs.
    Damaged,
    /// A build with other messages wrote it.
    Version,
    /// A value is out of range.
    Value,
}

impl fmt::Display for SetupError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Damaged => "the stored configuration is damaged",
            Self::Version => "the stored configuration was written by a build with other messages",
            Self::Value => "the stored configuration has a value out of range",
        })
    }
}

impl core::error::Error for SetupError {}

impl Setup {
    /// Encodes the record; returns `None` if rows of the table are missing.
    pub fn encode(&self) -> Option<[u8; SETUP_LENGTH]> {
        if self.table.received() != u16::MAX {
            return None;
        }
        let mut bytes = [0; SETUP_LENGTH];
        let (content, sum) = bytes.split_at_mut_checked(CONTENT)?;
        let mut writer = Writer::new(content);
        writer.put(SCHEMA_HASH.to_le_bytes())?;
        self.configure.put(&mut writer)?;
        for row in self.table.rows() {
            row.put(&mut writer)?;
        }
        for row in self.limbs.places() {
            writer.put([u8::from(row.is_some())])?;
            row.unwrap_or_default().put(&mut writer)?;
        }
        let found = checksum([&*content]);
        sum.copy_from_slice(&found.to_le_bytes());
        Some(bytes)
    }

    /// Decodes a record.
    ///
    /// # Errors
    /// Returns an error if the record is damaged, of another version, or has a value out of range.
    pub fn decode(bytes: &[u8]) -> Result<Self, SetupError> {
        let (content, sum) = bytes.split_last_chunk::<4>().ok_or(SetupError::Damaged)?;
        if content.len() != CONTENT || checksum([content]) != u32::from_le_bytes(*sum) {
            return Err(SetupError::Damaged);
        }
        let mut reader = Reader::new(content);
        if u64::from_le_bytes(reader.take()) != SCHEMA_HASH {
            return Err(SetupError::Version);
        }
        let configure = Configure::take(&mut reader).map_err(|_| SetupError::Value)?;
        let mut table = SegmentTable::new();
        for _ in 0..SEGMENT_COUNT {
            table.insert(SegmentValues::take(&mut reader).map_err(|_| SetupError::Value)?);
        }
        let mut limbs = LimbTable::new();
        for _ in 0..LIMBS {
            let [is_there] = reader.take();
            let row = LimbSensor::take(&mut reader).map_err(|_| SetupError::Value)?;
            if is_there != 0 && !limbs.insert(&row) {
                return Err(SetupError::Value);
            }
        }
        Ok(Self {
            configure,
            table,
            limbs,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::{ArchSource, SensorKind};
    use super::super::packed_quaternion::PackedQuaternion;
    use super::*;
    use crate::aerodynamics::Aerodynamics;
    use crate::body::Segment;
    use crate::test_body;
    use proptest::prelude::*;

    fn setup() -> Setup {
        let table = SegmentTable::of(&test_body::reference_body().cast(), &Aerodynamics::paper());
        Setup {
            configure: Configure {
                preset: 2,
                sample_rate: 100.0,
                update_rate: 50.0,
                height: 1.8,
                air_density: 1.05,
                air_velocity: [1.0, -2.0, 0.0],
                arch_source: ArchSource::Posture,
                arch: 1.0,
                body_from_sensor: PackedQuaternion::default(),
                receiver_latency: 0.1,
                sensor: SensorKind::Xbus,
                table_digest: table.digest(),
            },
            table,
            limbs: LimbTable::new(),
        }
    }

    #[test]
    fn what_was_stored_is_read_back() {
        let bytes = setup().encode().unwrap();
        assert_eq!(Setup::decode(&bytes), Ok(setup()));
        let mut worn = setup();
        for segment in [Segment::LeftShank, Segment::Pelvis, Segment::Thorax] {
            let sensor = LimbSensor {
                segment,
                place: [0.01, -0.02, 0.1],
                ..LimbSensor::default()
            };
            assert!(worn.limbs.insert(&sensor));
        }
        assert_eq!(Setup::decode(&worn.encode().unwrap()), Ok(worn));
        assert_eq!(Setup::decode(&bytes[1..]), Err(SetupError::Damaged));
        let incomplete = Setup {
            table: SegmentTable::new(),
            ..setup()
        };
        assert_eq!(incomplete.encode(), None);
    }

    #[test]
    fn a_record_of_another_build_is_refused() {
        let mut bytes = setup().encode().unwrap();
        bytes[0] ^= 1;
        let sum = checksum([&bytes[..CONTENT]]);
        bytes[CONTENT..].copy_from_slice(&sum.to_le_bytes());
        assert_eq!(Setup::decode(&bytes), Err(SetupError::Version));
    }

    proptest! {
        #[test]
        fn a_changed_byte_is_noticed(place in 0..SETUP_LENGTH, change in 1_u8..) {
            let mut bytes = setup().encode().unwrap();
            bytes[place] ^= change;
            prop_assert_eq!(Setup::decode(&bytes), Err(SetupError::Damaged));
        }
    }
}
