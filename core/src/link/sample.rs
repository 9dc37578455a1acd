//! Samples: posture and pelvis motion in 111 bytes. Quantisation happens here and nowhere else.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::message::Sample;
use super::wire::{BadValue, Reader, Wire, Writer};
use crate::body::posture::Posture;
use crate::body::{SEGMENT_COUNT, Segment};
use crate::frame::{Body, Inertial, Rotation, Vector};
use crate::math::{self, Real};

/// Counts for the largest value a component other than the largest can have, 1/sqrt(2).
const COMPONENT_COUNTS: i32 = 16_383;
/// Counts for a component of one.
const COUNTS_PER_UNIT: f32 = 23_169.06;
/// In a unit quaternion the three components beside the largest have squares of at most 3/4 together;
/// rounding each to half a count adds less than the second term.
const SQUARES_MAX: i32 = COMPONENT_COUNTS * COMPONENT_COUNTS / 2 * 3 + 40_000;

const ANGULAR_VELOCITY_COUNTS: f32 = 1024.0;
const SPEED_COUNTS: f32 = 256.0;

/// A rotation in 48 bits: the three smaller components of its quaternion in 15 bits each.
///
/// Bits 0-14, 15-29 and 30-44 hold the components beside the largest in the order w, x, y, z as counts of
/// 1/23169.06 plus 16383, bits 45-46 which one is the largest (made positive), bit 47 is zero. The
/// rotation error is at most 1.5e-4 rad (0.009 deg).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PackedQuaternion([u8; 6]);

impl Default for PackedQuaternion {
    fn default() -> Self {
        Self::from_parts(0, [0; 3])
    }
}

impl PackedQuaternion {
    /// The nearest packed rotation.
    pub fn pack(rotation: &UnitQuaternion<f32>) -> Self {
        // The bound of the error holds for unit length, and a joint may be off by 1e-3.
        let unit = math::normalized(**rotation);
        let wxyz = [unit.w, unit.i, unit.j, unit.k];
        let (largest, value) =
            (0u8..)
                .zip(wxyz)
                .fold((0, 0.0f32), |(index, value), (i, candidate)| {
                    if candidate.abs() > value.abs() {
                        (i, candidate)
                    } else {
                        (index, value)
                    }
                });
        let scale = if value < 0.0 {
            -COUNTS_PER_UNIT
        } else {
            COUNTS_PER_UNIT
        };
        let counts = others(largest, wxyz).map(|component| {
            let limit = 16_383.0;
            whole(math::clamp(component * scale, -limit, limit))
        });
        Self::from_parts(largest, counts)
    }

    /// The rotation.
    pub fn unpack(self) -> UnitQuaternion<f32> {
        let (largest, counts) = self.parts();
        #[expect(clippy::cast_precision_loss, reason = "15 bits")]
        let [a, b, c] = counts.map(|count| count as f32 / COUNTS_PER_UNIT);
        let l = (1.0 - (a * a + b * b + c * c)).root();
        UnitQuaternion::new_unchecked(match largest {
            0 => Quaternion::new(l, a, b, c),
            1 => Quaternion::new(a, l, b, c),
            2 => Quaternion::new(a, b, l, c),
            _ => Quaternion::new(a, b, c, l),
        })
    }

    fn from_parts(largest: u8, counts: [i32; 3]) -> Self {
        let [a, b, c] = counts.map(|count| u64::from((count + COMPONENT_COUNTS).unsigned_abs()));
        let bits = a | b << 15 | c << 30 | u64::from(largest) << 45;
        let [b0, b1, b2, b3, b4, b5, ..] = bits.to_le_bytes();
        Self([b0, b1, b2, b3, b4, b5])
    }

    fn parts(self) -> (u8, [i32; 3]) {
        let [b0, b1, b2, b3, b4, b5] = self.0;
        let low = u32::from_le_bytes([b0, b1, b2, b3]);
        let high = u32::from_le_bytes([b3, b4, b5, 0]);
        let count = |bits: u32| (bits & 0x7FFF).cast_signed() - COMPONENT_COUNTS;
        (b5 >> 5, [count(low), count(low >> 15), count(high >> 6)])
    }
}

impl Wire for PackedQuaternion {
    const SIZE: usize = 6;
    const KIND: &'static str = "packed quaternion";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put(self.0)
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        let packed = Self(reader.take());
        let (largest, counts) = packed.parts();
        let squares: i32 = counts.iter().map(|count| count * count).sum();
        let in_range = counts.iter().all(|&count| count <= COMPONENT_COUNTS);
        if largest < 4 && in_range && squares <= SQUARES_MAX {
            Ok(packed)
        } else {
            Err(BadValue::OutOfRange)
        }
    }
}

/// The components beside the one numbered `largest`, in order.
fn others(largest: u8, [w, x, y, z]: [f32; 4]) -> [f32; 3] {
    match largest {
        0 => [x, y, z],
        1 => [w, y, z],
        2 => [w, x, z],
        _ => [w, x, y],
    }
}

#[expect(
    clippy::cast_possible_truncation,
    reason = "the argument is a whole number within the range"
)]
fn whole(value: f32) -> i32 {
    value.nearest() as i32
}

/// Which parts of a [`Sample`] hold a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Validity(u8);

impl Validity {
    /// The 15 joint rotations.
    pub const POSTURE: Self = Self(1 << 0);
    /// The attitude of the pelvis.
    pub const ATTITUDE: Self = Self(1 << 1);
    /// The angular velocity of the pelvis.
    pub const ANGULAR_VELOCITY: Self = Self(1 << 2);
    /// The velocity of the pelvis.
    pub const VELOCITY: Self = Self(1 << 3);
    /// The horizontal speed from GNSS.
    pub const HORIZONTAL_SPEED: Self = Self(1 << 4);

    const ALL: u8 = 0x1F;

    /// Whether all parts in `parts` are valid.
    pub const fn contains(self, parts: Self) -> bool {
        self.0 & parts.0 == parts.0
    }

    /// The bits, bit 0 for the posture.
    pub const fn bits(self) -> u8 {
        self.0
    }

    #[must_use]
    const fn with(self, parts: Self) -> Self {
        Self(self.0 | parts.0)
    }
}

impl Wire for Validity {
    const SIZE: usize = 1;
    const KIND: &'static str =
        "u8: bit 0 posture, 1 attitude, 2 angular velocity, 3 velocity, 4 horizontal speed";
    fn put(self, writer: &mut Writer<'_>) -> Option<()> {
        writer.put([self.0])
    }
    fn take(reader: &mut Reader<'_>) -> Result<Self, BadValue> {
        let [bits] = reader.take();
        if bits & !Self::ALL == 0 {
            Ok(Self(bits))
        } else {
            Err(BadValue::OutOfRange)
        }
    }
}

/// Motion of the pelvis as far as it is measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Angular velocity relative to the inertial frame, in body axes (rad/s), below 32 in each.
    pub angular_velocity: Option<Vector<f32, Body>>,
    /// Velocity relative to the inertial frame (m/s), below 128 in each.
    pub velocity: Option<Vector<f32, Inertial>>,
    /// Horizontal speed from GNSS (m/s), below 256.
    pub horizontal_speed: Option<f32>,
}

impl Sample {
    /// Quantises a posture, an attitude and a motion.
    ///
    /// What is not finite or beyond the scale is marked as absent: a receiver never sees a value that was
    /// not measured.
    pub fn new(
        posture: &Posture<f32>,
        inertial_from_body: &Rotation<f32, Inertial, Body>,
        motion: &Motion,
    ) -> Self {
        let mut sample = Self {
            valid: Validity::default(),
            rotations: [PackedQuaternion::default(); SEGMENT_COUNT],
            angular_velocity: [0; 3],
            velocity: [0; 3],
            horizontal_speed: 0,
        };
        let attitude = inertial_from_body.quaternion();
        let (with_posture, with_attitude) = (posture.is_valid(), is_unit(attitude));
        for (packed, segment) in sample.rotations.iter_mut().zip(Segment::ALL) {
            match segment {
                Segment::Pelvis if with_attitude => *packed = PackedQuaternion::pack(attitude),
                Segment::Pelvis => {}
                _ if with_posture => {
                    *packed = PackedQuaternion::pack(posture.parent_from_segment(segment));
                }
                _ => {}
            }
        }
        if with_posture {
            sample.valid = sample.valid.with(Validity::POSTURE);
        }
        if with_attitude {
            sample.valid = sample.valid.with(Validity::ATTITUDE);
        }
        let measured = motion.angular_velocity.map(|v| v.components);
        if let Some(counts) = counts_of(measured, ANGULAR_VELOCITY_COUNTS) {
            sample.angular_velocity = counts;
            sample.valid = sample.valid.with(Validity::ANGULAR_VELOCITY);
        }
        let measured = motion.velocity.map(|v| v.components);
        if let Some(counts) = counts_of(measured, SPEED_COUNTS) {
            sample.velocity = counts;
            sample.valid = sample.valid.with(Validity::VELOCITY);
        }
        let counts = motion
            .horizontal_speed
            .filter(|speed| (0.0..255.99).contains(speed))
            .and_then(|speed| u16::try_from(whole(speed * SPEED_COUNTS)).ok());
        if let Some(counts) = counts {
            sample.horizontal_speed = counts;
            sample.valid = sample.valid.with(Validity::HORIZONTAL_SPEED);
        }
        sample
    }

    /// The posture; the H-pose where it is not valid.
    pub fn posture(&self) -> Posture<f32> {
        let mut posture = Posture::h_pose();
        for (segment, packed) in Segment::ALL.into_iter().zip(self.rotations) {
            posture.set(segment, packed.unpack());
        }
        posture
    }

    /// The attitude of the pelvis; identity where it is not valid.
    pub fn inertial_from_body(&self) -> Rotation<f32, Inertial, Body> {
        let [attitude, ..] = self.rotations;
        Rotation::from_quaternion(attitude.unpack())
    }

    /// The motion of the pelvis.
    pub fn motion(&self) -> Motion {
        let vector = |counts: [i16; 3], part: Validity, scale: f32| {
            self.valid
                .contains(part)
                .then(|| Vector3::from(counts).map(|count| f32::from(count) / scale))
        };
        Motion {
            angular_velocity: vector(
                self.angular_velocity,
                Validity::ANGULAR_VELOCITY,
                ANGULAR_VELOCITY_COUNTS,
            )
            .map(Vector::from_components),
            velocity: vector(self.velocity, Validity::VELOCITY, SPEED_COUNTS)
                .map(Vector::from_components),
            horizontal_speed: self
                .valid
                .contains(Validity::HORIZONTAL_SPEED)
                .then(|| f32::from(self.horizontal_speed) / SPEED_COUNTS),
        }
    }
}

fn is_unit(rotation: &UnitQuaternion<f32>) -> bool {
    let size = rotation.coords.norm_squared();
    (size - 1.0).abs() < 2e-3
}

/// Counts of all three components, `None` where one is not finite or off the scale.
fn counts_of(vector: Option<Vector3<f32>>, scale: f32) -> Option<[i16; 3]> {
    let [x, y, z]: [f32; 3] = vector?.into();
    // Not a number becomes 0 in the cast, so it is refused here.
    let count = |value: f32| {
        value
            .is_finite()
            .then(|| i16::try_from(whole(value * scale)).ok())
            .flatten()
    };
    Some([count(x)?, count(y)?, count(z)?])
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn rotation_error(a: &UnitQuaternion<f32>, b: &UnitQuaternion<f32>) -> f64 {
        let difference = a.cast::<f64>().inverse() * b.cast::<f64>();
        2.0 * libm::asin(difference.imag().norm().min(1.0))
    }

    fn any_rotation() -> impl Strategy<Value = UnitQuaternion<f32>> {
        prop::array::uniform4(-1.0f32..1.0)
            .prop_filter("has a direction", |q| {
                q.iter().map(|c| c * c).sum::<f32>() > 1e-3
            })
            .prop_map(|[w, x, y, z]| math::normalized(Quaternion::new(w, x, y, z)))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn packing_turns_a_rotation_by_less_than_stated(rotation in any_rotation()) {
            let unpacked = PackedQuaternion::pack(&rotation).unpack();
            prop_assert!(rotation_error(&rotation, &unpacked) < 1.505e-4);
            prop_assert!((unpacked.coords.norm() - 1.0).abs() < 3e-7);
        }

        #[test]
        fn both_signs_pack_alike_and_packing_again_changes_nothing(rotation in any_rotation()) {
            let packed = PackedQuaternion::pack(&rotation);
            let opposite = UnitQuaternion::new_unchecked(-*rotation);
            // Components equally large may lead either way.
            prop_assert!(
                rotation_error(&PackedQuaternion::pack(&opposite).unpack(), &packed.unpack()) < 3.0e-4
            );
            let again = PackedQuaternion::pack(&packed.unpack());
            prop_assert!(rotation_error(&again.unpack(), &packed.unpack()) < 1.505e-4);
        }

        #[test]
        fn what_packs_is_accepted_and_what_is_accepted_is_a_rotation(
            rotation in any_rotation(),
            bytes in prop::array::uniform6(any::<u8>()),
        ) {
            let packed = PackedQuaternion::pack(&rotation);
            prop_assert_eq!(PackedQuaternion::take(&mut Reader::new(&packed.0)), Ok(packed));
            if let Ok(accepted) = PackedQuaternion::take(&mut Reader::new(&bytes)) {
                prop_assert!((accepted.unpack().coords.norm() - 1.0).abs() < 1e-4);
            }
        }

        #[test]
        fn motion_survives_within_half_a_count(
            w in prop::array::uniform3(-31.9f32..31.9),
            v in prop::array::uniform3(-127.9f32..127.9),
            speed in 0.0f32..255.9,
        ) {
            let motion = Motion {
                angular_velocity: Some(Vector::from_components(w.into())),
                velocity: Some(Vector::from_components(v.into())),
                horizontal_speed: Some(speed),
            };
            let read = Sample::new(&Posture::h_pose(), &Rotation::identity(), &motion).motion();
            let off = |a: Vector3<f32>, b: [f32; 3]| (a - Vector3::from(b)).abs().max();
            prop_assert!(off(read.angular_velocity.unwrap().components, w) <= 0.5001 / 1024.0);
            prop_assert!(off(read.velocity.unwrap().components, v) <= 0.5001 / 256.0);
            prop_assert!((read.horizontal_speed.unwrap() - speed).abs() <= 0.5001 / 256.0);
        }
    }

    #[test]
    fn the_worst_corner_meets_the_bound() {
        // All components equal: the error of the three goes fully into the fourth.
        let mut worst = 0.0f64;
        for a in 0..40u8 {
            for b in 0..40u8 {
                let step = |n: u8| 0.5 + f32::from(n) * 1.1e-6;
                let rotation =
                    math::normalized(Quaternion::new(0.50005, step(a), step(b), step(a)));
                let error = rotation_error(&rotation, &PackedQuaternion::pack(&rotation).unpack());
                worst = worst.max(error);
            }
        }
        assert!((1.3e-4..1.505e-4).contains(&worst), "{worst}");
    }

    #[test]
    fn a_posture_returns_joint_by_joint() {
        let posture = Posture::h_pose()
            .with_angles(Segment::LeftHand, 0.3, -0.2, 1.1)
            .with_angles(Segment::Head, -0.1, 0.4, 0.0);
        let attitude = Rotation::from_wxyz([0.1, -0.7, 0.2, 0.6]).unwrap();
        let sample = Sample::new(&posture, &attitude, &Motion::default());
        assert_eq!(sample.valid, Validity::POSTURE.with(Validity::ATTITUDE));
        let read = sample.posture();
        for segment in Segment::ALL {
            let (sent, got) = (
                posture.parent_from_segment(segment),
                read.parent_from_segment(segment),
            );
            assert!(rotation_error(sent, got) < 1.505e-4, "{segment:?}");
        }
        let got = sample.inertial_from_body();
        assert!(rotation_error(attitude.quaternion(), got.quaternion()) < 1.505e-4);
        assert_eq!(sample.motion(), Motion::default());
    }

    #[test]
    fn values_that_cannot_be_told_are_absent() {
        let broken = UnitQuaternion::new_unchecked(Quaternion::new(f32::NAN, 0.0, 0.0, 1.0));
        for value in [f32::NAN, f32::INFINITY, -400.0, 1.0e30] {
            let motion = Motion {
                angular_velocity: Some(Vector::new(0.0, value, 0.0)),
                velocity: Some(Vector::new(0.0, 0.0, value)),
                horizontal_speed: Some(value),
            };
            let sample = Sample::new(
                &Posture::h_pose().with(Segment::Head, broken),
                &Rotation::from_quaternion(broken),
                &motion,
            );
            assert_eq!(sample.valid.bits(), 0, "{value}");
            assert_eq!(sample.posture(), Posture::h_pose());
            assert_eq!(sample.motion(), Motion::default());
        }
    }
}
