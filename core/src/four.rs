//! Four bodies side by side, in registers of 128 bits: in single precision, and in double precision in two of them.

use simba::simd::{SimdBool, SimdComplexField, SimdPartialOrd, SimdValue, WideF32x4, WideF64x4};

use crate::math::{Lanes, single_arctangent2, single_sine_cosine};

/// The numbers of four bodies in single precision.
pub type Four = WideF32x4;

impl Lanes for Four {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self::splat(f32::of(value))
    }
    #[inline(always)]
    fn single(value: f32) -> Self {
        Self::splat(value)
    }
    #[inline]
    fn sine_cosine(self) -> (Self, Self) {
        single_sine_cosine(self)
    }
    #[inline]
    fn arctangent2(self, x: Self) -> Self {
        single_arctangent2(self, x)
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.greater(Self::ZERO).simd_sqrt()
    }
    fn power(self, exponent: Self) -> Self {
        self.zip_map(exponent, libm::powf)
    }
    #[inline(always)]
    fn nearest(self) -> Self {
        Self(self.0.round())
    }
    #[inline(always)]
    fn finite(self) -> Self::SimdBool {
        self.simd_abs().simd_lt(Self::splat(f32::INFINITY))
    }
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        self.simd_gt(other).if_else(|| self, || other)
    }
}

/// The numbers of four bodies in double precision.
pub type FourDouble = WideF64x4;

impl Lanes for FourDouble {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Self::splat(value)
    }
    #[inline(always)]
    fn single(value: f32) -> Self {
        Self::splat(value.into())
    }
    fn sine_cosine(self) -> (Self, Self) {
        let both = self.into_arr().map(libm::sincos);
        let [sines, cosines] = [both.map(|both| both.0), both.map(|both| both.1)];
        (Self::from_arr(sines), Self::from_arr(cosines))
    }
    fn arctangent2(self, x: Self) -> Self {
        self.zip_map(x, libm::atan2)
    }
    #[inline(always)]
    fn root(self) -> Self {
        self.greater(Self::ZERO).simd_sqrt()
    }
    fn power(self, exponent: Self) -> Self {
        self.zip_map(exponent, libm::pow)
    }
    fn nearest(self) -> Self {
        self.map(libm::round)
    }
    #[inline(always)]
    fn finite(self) -> Self::SimdBool {
        self.simd_abs().simd_lt(Self::splat(f64::INFINITY))
    }
    #[inline(always)]
    fn greater(self, other: Self) -> Self {
        self.simd_gt(other).if_else(|| self, || other)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::clamp;
    use proptest::prelude::*;

    /// Bits of a number; all kinds of NaN are the same.
    fn bits(number: f32) -> u32 {
        if number.is_nan() {
            f32::NAN.to_bits()
        } else {
            number.to_bits()
        }
    }

    fn assert_lanes(found: Four, alone: [f32; 4]) {
        assert_eq!(
            found.into_arr().map(bits),
            alone.map(bits),
            "{found:?} {alone:?}"
        );
    }

    /// Numbers of any kind, and those of angles and shares more often.
    fn any_number() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            -100.0f32..100.0,
            (-40i8..40).prop_map(|halves| f32::from(halves) * 0.5),
        ]
    }

    proptest! {
        #[test]
        fn every_lane_has_the_bits_of_a_number_alone(
            a in prop::array::uniform4(any_number()),
            b in prop::array::uniform4(any_number()),
        ) {
            let (x, y) = (Four::from_arr(a), Four::from_arr(b));
            let both = |alone: fn(f32, f32) -> f32| core::array::from_fn(|lane| alone(a[lane], b[lane]));
            assert_lanes(x.nearest(), a.map(f32::nearest));
            assert_lanes(x.root(), a.map(f32::root));
            assert_lanes(x.sine_cosine().0, a.map(|a| a.sine_cosine().0));
            assert_lanes(x.sine_cosine().1, a.map(|a| a.sine_cosine().1));
            assert_lanes(x.arctangent2(y), both(f32::arctangent2));
            assert_lanes(x.greater(y), both(f32::greater));
            assert_lanes(x.root().power(y), both(|a, b| a.root().power(b)));
            assert_lanes(clamp(x, -Four::ONE, Four::ONE), a.map(|a| clamp(a, -1.0, 1.0)));
            for (lane, number) in a.into_iter().enumerate() {
                prop_assert_eq!(x.finite().extract(lane), number.finite());
            }
        }
    }

    proptest! {
        #[test]
        fn every_lane_has_the_bits_of_a_double_alone(
            a in prop::array::uniform4(any_double()),
            b in prop::array::uniform4(any_double()),
        ) {
            let (x, y) = (FourDouble::from_arr(a), FourDouble::from_arr(b));
            let both = |alone: fn(f64, f64) -> f64| core::array::from_fn(|lane| alone(a[lane], b[lane]));
            assert_doubles(x.nearest(), a.map(f64::nearest));
            assert_doubles(x.root(), a.map(f64::root));
            assert_doubles(x.sine_cosine().0, a.map(|a| a.sine_cosine().0));
            assert_doubles(x.sine_cosine().1, a.map(|a| a.sine_cosine().1));
            assert_doubles(x.arctangent2(y), both(f64::arctangent2));
            assert_doubles(x.greater(y), both(f64::greater));
            assert_doubles(x.root().power(y), both(|a, b| a.root().power(b)));
            assert_doubles(clamp(x, -FourDouble::ONE, FourDouble::ONE), a.map(|a| clamp(a, -1.0, 1.0)));
            for (lane, number) in a.into_iter().enumerate() {
                prop_assert_eq!(x.finite().extract(lane), number.finite());
            }
        }
    }

    fn any_double() -> impl Strategy<Value = f64> {
        prop_oneof![
            any::<u64>().prop_map(f64::from_bits),
            -100.0f64..100.0,
            (-40i8..40).prop_map(|halves| f64::from(halves) * 0.5),
        ]
    }

    fn assert_doubles(found: FourDouble, alone: [f64; 4]) {
        let bits = |number: f64| {
            if number.is_nan() {
                f64::NAN.to_bits()
            } else {
                number.to_bits()
            }
        };
        assert_eq!(
            found.into_arr().map(bits),
            alone.map(bits),
            "{found:?} {alone:?}"
        );
    }
}
