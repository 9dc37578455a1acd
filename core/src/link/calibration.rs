//! Messages about sensors on the limbs: their calibration, its course, and how the line and the postures are.

use nalgebra::Vector3;

use super::packed_quaternion::{PackedQuaternion, whole};
use super::wire::{body, code};
use crate::body::{SEGMENT_COUNT, Segment, SegmentArray};
use crate::math::Lanes;
use crate::suit::mounting::Mounting;
use crate::suit::set::Fitted;
use crate::suit::tray::Gyroscope;

/// Most sensors on the limbs that a unit uses.
pub const LIMBS: usize = 10;

body! {
    /// Either way: a calibrated sensor on a limb, a row of the stored configuration. The host may write rows back; the first
    /// one of the pelvis forgets all others.
    LimbSensor {
        /// Segment that carries it
        segment: Segment = "",
        /// Place in the segment's frame: x, y, z
        place: [f32; 3] = "m" in -3.0..=3.0,
        /// Bias of the gyroscope, sensor axes: x, y, z
        bias: [f32; 3] = "rad/s" in -1.0..=1.0,
        /// Standard deviation of the bias
        bias_deviation: f32 = "rad/s" in 0.0..=1.0,
        /// Factor on each axis after the bias is taken off: x, y, z
        gain: [f32; 3] = "" in 0.5..=2.0,
        /// Standard deviations of the factors: x, y, z
        gain_deviation: [f32; 3] = "" in 0.0..=1.0,
        /// Mounting: sensor axes to segment axes
        segment_from_sensor: PackedQuaternion = "",
        /// Standard deviation of the segment's tilt in the upright pose, each axis
        tilt_deviation: f32 = "rad" in 0.0..=3.2,
        /// Standard deviation of the heading
        heading_deviation: f32 = "rad" in 0.0..=3.2,
    }
}

impl Default for LimbSensor {
    fn default() -> Self {
        Self::new(&Fitted {
            segment: Segment::Pelvis,
            place: Vector3::zeros(),
            gyroscope: Gyroscope::default(),
            mounting: Mounting {
                segment_from_sensor: nalgebra::UnitQuaternion::identity(),
                tilt_deviation: 0.0,
                heading_deviation: 0.0,
            },
            range: None,
        })
    }
}

/// Rate from which the gyroscope of a node is taken as saturated (rad/s): just below 2000 deg/s, the usual range.
const RANGE: f32 = 34.9;

impl LimbSensor {
    /// The row of a sensor.
    pub fn new(fitted: &Fitted<f32>) -> Self {
        let Fitted {
            segment,
            place,
            gyroscope,
            mounting,
            ..
        } = fitted;
        Self {
            segment: *segment,
            place: (*place).into(),
            bias: gyroscope.bias.into(),
            bias_deviation: gyroscope.bias_deviation,
            gain: gyroscope.gain.into(),
            gain_deviation: gyroscope.gain_deviation.into(),
            segment_from_sensor: PackedQuaternion::pack(&mounting.segment_from_sensor),
            tilt_deviation: mounting.tilt_deviation,
            heading_deviation: mounting.heading_deviation,
        }
    }

    /// The sensor.
    pub fn fitted(&self) -> Fitted<f32> {
        Fitted {
            segment: self.segment,
            place: self.place.into(),
            gyroscope: Gyroscope {
                bias: self.bias.into(),
                gain: self.gain.into(),
                bias_deviation: self.bias_deviation,
                gain_deviation: self.gain_deviation.into(),
            },
            mounting: Mounting {
                segment_from_sensor: self.segment_from_sensor.unpack(),
                tilt_deviation: self.tilt_deviation,
                heading_deviation: self.heading_deviation,
            },
            range: Some(RANGE),
        }
    }
}

/// The calibrated sensors on the limbs, none of two on the same segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LimbTable {
    rows: [Option<LimbSensor>; LIMBS],
}

impl Default for LimbTable {
    fn default() -> Self {
        Self::new()
    }
}

impl LimbTable {
    /// Without a sensor.
    pub const fn new() -> Self {
        Self {
            rows: [None; LIMBS],
        }
    }

    /// Adds or replaces a sensor; returns whether there is room for it.
    pub fn insert(&mut self, sensor: &LimbSensor) -> bool {
        let is_same = |row: &&mut Option<LimbSensor>| {
            row.is_none_or(|row: LimbSensor| row.segment == sensor.segment)
        };
        let place = self.rows.iter_mut().find(is_same);
        place.map(|row| *row = Some(*sensor)).is_some()
    }

    /// The sensors.
    pub fn rows(&self) -> impl Iterator<Item = &LimbSensor> {
        self.rows.iter().flatten()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.rows().next().is_none()
    }

    /// All places, also the empty ones.
    pub(super) fn places(&self) -> impl Iterator<Item = Option<LimbSensor>> {
        self.rows.iter().copied()
    }
}

body! {
    /// Host to unit: forgets the calibration of the sensors on the limbs and begins a new one; answered by [`Calibration`].
    Calibrate {}
}

code! {
    /// What the sensors on the limbs do.
    CalibrationStage {
        /// The unit has none
        Absent = 0,
        /// They wait for the poses: tray and turns if wanted, upright, bent, march, upright
        Poses = 1,
        /// They are calibrated, and wait for the person to stand upright and still
        Waiting = 2,
        /// Postures follow
        Worn = 3,
    }
}

code! {
    /// How the last calibration ended.
    CalibrationVerdict {
        /// There was none since the start
        Nothing = 0,
        /// Good
        Good = 1,
        /// There is no sensor on the pelvis
        NoPelvis = 2,
        /// More sensors than the unit has room for
        TooMany = 3,
        /// How a sensor lies on its segment does not follow from bend and march
        NoHeading = 4,
        /// Bend and march contradict each other: the sensor is on another segment, or was turned in between
        Contradiction = 5,
    }
}

body! {
    /// Unit to host: state of the calibration, when it changes and in answer to [`Calibrate`].
    Calibration {
        /// What the sensors do
        stage: CalibrationStage = "",
        /// How the last calibration ended
        verdict: CalibrationVerdict = "",
        /// The sensor that the verdict is about; the pelvis if it is about all
        segment: Segment = "",
        /// Rests of all sensors that were taken since the calibration began
        rests: u8 = "",
        /// Sensors heard in the last cycle, a bit for each segment
        heard: u16 = "",
        /// Sensors whose scale was calibrated by full turns, a bit for each segment
        turned: u16 = "",
    }
}

/// Counts of a radian.
const ERROR_COUNTS: f32 = 200.0;

body! {
    /// Unit to host and in its log: standard deviations of the segments' orientations relative to the pelvis from the sample
    /// with the same number on.
    SegmentErrors {
        /// Standard deviation about each axis, in table order
        deviation: [u8; SEGMENT_COUNT] = "1/200 rad",
        /// Sensors that are missing, have failed or have slipped, a bit for each segment
        failed: u16 = "",
    }
}

impl SegmentErrors {
    /// Quantises deviations (rad), upwards, to at least one count; the largest for a number that is none.
    pub fn new(deviations: &SegmentArray<f32>, failed: u16) -> Self {
        let mut deviation = [1; SEGMENT_COUNT];
        for (place, (_, wanted)) in deviation.iter_mut().zip(deviations.iter()) {
            let counts = *wanted * ERROR_COUNTS + 0.5;
            // What is unknown has the largest error.
            let counts = if counts.is_finite() {
                whole(counts).max(1)
            } else {
                i32::MAX
            };
            *place = u8::try_from(counts).unwrap_or(u8::MAX);
        }
        Self { deviation, failed }
    }

    /// The deviations (rad).
    pub fn deviations(&self) -> SegmentArray<f32> {
        let counts = |segment: Segment| self.deviation.get(segment as usize).copied();
        SegmentArray::from_fn(|s| {
            f32::single(f32::from(counts(s).unwrap_or(u8::MAX)) / ERROR_COUNTS)
        })
    }

    /// Whether any of them differs by more than a tenth, or another sensor has failed.
    pub fn differs_from(&self, other: &Self) -> bool {
        let pairs = self.deviation.iter().zip(&other.deviation);
        self.failed != other.failed
            || pairs
                .into_iter()
                .any(|(one, other)| one.abs_diff(*other) > 1 + other / 10)
    }
}

body! {
    /// Unit to host, once a second: the line of the sensors on the limbs, since the unit started. All counters wrap.
    ChainReport {
        /// Whole packets
        packets: u32 = "",
        /// Bytes outside of packets: noise, damaged packets, or the messages of a receiver
        skipped: u32 = "bytes",
        /// Cycles without a packet of each node since it was heard first, by address
        missing: [u32; SEGMENT_COUNT] = "cycles",
        /// Packets of each node with a measurement that is too old, or that came twice or after their cycle
        late: [u16; SEGMENT_COUNT] = "",
        /// Age of each node's last measurement at the begin of its cycle
        age: [u8; SEGMENT_COUNT] = "1/10 ms",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_never_smaller_than_computed_and_change_by_steps() {
        let wanted = SegmentArray::from_fn(|segment| 0.011 * f32::from(segment as u8));
        let errors = SegmentErrors::new(&wanted, 2);
        for (segment, found) in errors.deviations().iter() {
            let wanted = wanted[segment];
            assert!(*found >= wanted && *found < wanted + 0.0101, "{segment:?}");
        }
        let beyond = SegmentErrors::new(&SegmentArray::from_fn(|_| f32::NAN), 2);
        assert_eq!(beyond.deviation, [u8::MAX; SEGMENT_COUNT]);
        assert!(errors.differs_from(&beyond) && !errors.differs_from(&errors));
    }

    #[test]
    fn a_segment_has_one_sensor_and_the_table_an_end() {
        let mut table = LimbTable::new();
        assert!(table.is_empty());
        for segment in Segment::ALL {
            let row = LimbSensor {
                segment,
                ..LimbSensor::default()
            };
            assert_eq!(
                table.insert(&row),
                (segment as usize) < LIMBS,
                "{segment:?}"
            );
            assert_eq!(
                table.insert(&row),
                (segment as usize) < LIMBS,
                "{segment:?}"
            );
        }
        assert_eq!(table.rows().count(), LIMBS);
        let row = table.rows().last().unwrap();
        assert_eq!(LimbSensor::new(&row.fitted()), *row);
    }
}
