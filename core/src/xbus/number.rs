//! The four number formats, decoded in place.

/// Format of the real numbers of an item, given by the two lowest bits of its identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NumberFormat {
    /// IEEE single precision.
    Float32,
    /// Fixed point with 32 bits, of which 20 are fractional.
    Fp1220,
    /// Fixed point with 48 bits, of which 32 are fractional; the fraction comes first.
    Fp1632,
    /// IEEE double precision.
    Float64,
}

impl NumberFormat {
    pub(super) const fn of(id: u16) -> Self {
        match id & 3 {
            0 => Self::Float32,
            1 => Self::Fp1220,
            2 => Self::Fp1632,
            _ => Self::Float64,
        }
    }

    /// Size of one number (bytes).
    pub const fn size(self) -> usize {
        match self {
            Self::Float32 | Self::Fp1220 => 4,
            Self::Fp1632 => 6,
            Self::Float64 => 8,
        }
    }
}

/// `N` real numbers as received, which are converted to a floating-point format on demand.
///
/// Conversion to single precision uses integer operations for every format, so a processor without double-precision
/// hardware never needs it; the result is the nearest `f32`. Positions need [`Reals::to_f64`], because a latitude in
/// single precision is accurate to 0.4 m only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reals<'a, const N: usize> {
    bytes: &'a [u8],
    format: NumberFormat,
}

impl<'a, const N: usize> Reals<'a, N> {
    /// Returns `None` if `bytes` does not have the size of `N` numbers.
    pub(super) fn new(bytes: &'a [u8], format: NumberFormat) -> Option<Self> {
        (bytes.len() == N * format.size()).then_some(Self { bytes, format })
    }

    /// Returns the number format on the wire.
    pub const fn format(&self) -> NumberFormat {
        self.format
    }

    /// Converts the numbers to single precision.
    pub fn to_f32(&self) -> [f32; N] {
        match self.format {
            NumberFormat::Float32 => self.read(f32::from_be_bytes),
            NumberFormat::Fp1220 => {
                self.read(|bytes| nearest(i64::from(i32::from_be_bytes(bytes)), 20))
            }
            NumberFormat::Fp1632 => self.read(|bytes| nearest(fp1632(bytes), 32)),
            NumberFormat::Float64 => self.read(|bytes| narrow(u64::from_be_bytes(bytes))),
        }
    }

    /// Converts the numbers to double precision, which is exact for every format.
    pub fn to_f64(&self) -> [f64; N] {
        match self.format {
            NumberFormat::Float32 => self.read(|bytes| f64::from(f32::from_be_bytes(bytes))),
            NumberFormat::Fp1220 => {
                self.read(|bytes| f64::from(i32::from_be_bytes(bytes)) / 1_048_576.0)
            }
            #[expect(clippy::cast_precision_loss, reason = "48 bits")]
            NumberFormat::Fp1632 => self.read(|bytes| fp1632(bytes) as f64 / 4_294_967_296.0),
            NumberFormat::Float64 => self.read(f64::from_be_bytes),
        }
    }

    fn read<const SIZE: usize, R: Default + Copy>(
        &self,
        number: impl Fn([u8; SIZE]) -> R,
    ) -> [R; N] {
        let mut numbers = [R::default(); N];
        for (place, bytes) in numbers.iter_mut().zip(self.bytes.as_chunks::<SIZE>().0) {
            *place = number(*bytes);
        }
        numbers
    }
}

/// Decodes to counts of 2^-32: the fraction comes first, then the signed integer part.
fn fp1632([f0, f1, f2, f3, w0, w1]: [u8; 6]) -> i64 {
    let fraction = u32::from_be_bytes([f0, f1, f2, f3]);
    i64::from(i16::from_be_bytes([w0, w1])) << 32 | i64::from(fraction)
}

/// The `f32` nearest to `counts` / 2^`places`. The division is exact, as it only changes the exponent.
#[expect(
    clippy::cast_precision_loss,
    reason = "rounding once to single is the purpose"
)]
fn nearest(counts: i64, places: u32) -> f32 {
    counts as f32 * f32::from_bits((127 - places) << 23)
}

/// The `f32` nearest to a double given by its bits, rounding halves to even, as `as f32` does.
#[expect(
    clippy::cast_possible_truncation,
    reason = "each value is masked or shifted to fit"
)]
const fn narrow(bits: u64) -> f32 {
    let sign = (bits >> 32) as u32 & 0x8000_0000;
    let exponent = (bits >> 52) as i32 & 0x7FF;
    let fraction = bits & 0x000F_FFFF_FFFF_FFFF;
    let size = if exponent == 0x7FF {
        // An infinity or a quiet NaN.
        0x7F80_0000 | if fraction != 0 { 0x0040_0000 } else { 0 }
    } else if exponent > 1023 + 127 {
        0x7F80_0000
    } else if exponent >= 1023 - 126 {
        let truncated = ((exponent - (1023 - 127)) as u32) << 23 | (fraction >> 29) as u32;
        // A carry out of the fraction increments the exponent, as it should, up to infinity.
        truncated + round_up(fraction, 29)
    } else if exponent >= 1023 - 150 {
        let shift = (1023 - 126 + 29 - exponent) as u32;
        let whole = fraction | 1 << 52;
        (whole >> shift) as u32 + round_up(whole, shift)
    } else {
        0
    };
    f32::from_bits(sign | size)
}

/// Returns 1 if the `shift` bits that are cut off round up, with halves rounding to even.
const fn round_up(value: u64, shift: u32) -> u32 {
    let (rest, half) = (value & ((1 << shift) - 1), 1u64 << (shift - 1));
    let odd = value >> shift & 1 == 1;
    (rest > half || (rest == half && odd)) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of<const N: usize>(bytes: &[u8], format: NumberFormat) -> Reals<'_, N> {
        Reals::new(bytes, format).unwrap()
    }

    #[test]
    fn the_fraction_comes_first() {
        // From einride log 3: 57.6794421 deg north.
        let bytes = [0xAD, 0xEF, 0xEB, 0xA2, 0x00, 0x39];
        let [latitude] = of::<1>(&bytes, NumberFormat::Fp1632).to_f64();
        assert!((latitude - 57.679_442_1).abs() < 1e-7);
        let [minus_half] = of::<1>(&[0x80, 0, 0, 0, 0xFF, 0xFF], NumberFormat::Fp1632).to_f64();
        assert!((minus_half + 0.5).abs() < f64::EPSILON);
        assert!(Reals::<2>::new(&bytes, NumberFormat::Fp1632).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn narrowing_rounds_like_the_hardware(
            bits in any::<u64>(),
            near in any::<f32>(),
            low in 0u64..1 << 31,
        ) {
            for bits in [bits, f64::from(near).to_bits() ^ low] {
                let wide = f64::from_bits(bits);
                #[expect(clippy::cast_possible_truncation, reason = "the reference result")]
                let expected = wide as f32;
                let found = narrow(bits);
                prop_assert!(
                    found.to_bits() == expected.to_bits() || (found.is_nan() && expected.is_nan()),
                    "{wide:e}: {found:e} for {expected:e}"
                );
            }
        }

        #[test]
        fn fixed_point_is_the_nearest_single(short in any::<i32>(), whole in any::<i16>(), fraction in any::<u32>()) {
            let bytes = short.to_be_bytes();
            let [single] = of::<1>(&bytes, NumberFormat::Fp1220).to_f32();
            let [double] = of::<1>(&bytes, NumberFormat::Fp1220).to_f64();
            #[expect(clippy::cast_possible_truncation, reason = "the reference result")]
            let expected = double as f32;
            prop_assert_eq!(single.to_bits(), expected.to_bits());

            let ([a, b, c, d], [e, f]) = (fraction.to_be_bytes(), whole.to_be_bytes());
            let bytes = [a, b, c, d, e, f];
            let [single] = of::<1>(&bytes, NumberFormat::Fp1632).to_f32();
            let [double] = of::<1>(&bytes, NumberFormat::Fp1632).to_f64();
            #[expect(clippy::cast_possible_truncation, reason = "the reference result")]
            let expected = double as f32;
            prop_assert_eq!(single.to_bits(), expected.to_bits());
            prop_assert!((double - (f64::from(whole) + f64::from(fraction) / 4_294_967_296.0)).abs() < 1e-12);
        }
    }
}
