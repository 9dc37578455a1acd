//! Rotations packed into 48 bits.

use nalgebra::{Quaternion, UnitQuaternion};

use super::wire::{BadValue, Reader, Wire, Writer};
use crate::math::{self, Lanes};

/// Counts for 1/sqrt(2), the largest magnitude that any component but the largest can have.
const COMPONENT_COUNTS: i32 = 16_383;
/// Counts for a component equal to one.
const COUNTS_PER_UNIT: f32 = 23_169.06;
/// In a unit quaternion, the squares of the three components other than the largest sum to at most 3/4; rounding each
/// by up to half a count adds less than the second term.
const SQUARES_MAX: i32 = COMPONENT_COUNTS * COMPONENT_COUNTS / 2 * 3 + 40_000;

/// A rotation in 48 bits: the three smaller components of its quaternion in 15 bits each.
///
/// Bits 0-14, 15-29 and 30-44 hold the other three components in the order w, x, y, z, in counts of 1/23169.06 offset
/// by 16383; bits 45-46 hold the index of the largest component (made positive), and bit 47 is zero. The rotation
/// error is at most 1.5e-4 rad (0.009 deg).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PackedQuaternion([u8; 6]);

impl Default for PackedQuaternion {
    fn default() -> Self {
        Self::from_parts(0, [0; 3])
    }
}

impl PackedQuaternion {
    /// Packs the rotation, rounding it to the nearest representable one.
    pub fn pack(rotation: &UnitQuaternion<f32>) -> Self {
        // The error bound holds for unit norm, and a joint's norm may be off by 1e-3.
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

    /// Returns the rotation.
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

/// Returns the components except the one numbered `largest`, in order.
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
pub(super) fn whole(value: f32) -> i32 {
    value.nearest() as i32
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Angle between two rotations (rad).
    pub(in crate::link) fn rotation_error(a: &UnitQuaternion<f32>, b: &UnitQuaternion<f32>) -> f64 {
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
            // If components are equally large, either may be packed as the largest.
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
    }

    #[test]
    fn the_worst_corner_meets_the_bound() {
        // All components are equal, so the error of the three goes fully into the fourth.
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
}
