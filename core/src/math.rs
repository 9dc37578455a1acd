//! Elementary functions with bit-identical results on every machine, and small solvers of fixed cost.
//!
//! `f32` uses polynomials of its own, so hardware with single precision alone need not emulate double precision; `f64`
//! uses the `libm` crate. Square roots are correctly rounded in both. Nothing in this module calls the platform's maths
//! library.

use nalgebra::{
    Matrix3, RealField, SimdBool, SimdRealField, SimdValue, UnitQuaternion, Vector2, Vector3,
};

/// A number of the model for one body, or the numbers of several bodies side by side, each in a lane of its own.
///
/// Formulas are written once for any number of lanes: a comparison gives one truth value per lane, and a lane has the
/// bits that its body has alone.
pub trait Lanes: SimdRealField<Element: SimdRealField> + Copy + Default {
    /// Returns the scalar nearest to `value`, in all lanes.
    fn of(value: f64) -> Self;
    /// Converts a number from a table that the unit reads in flight; for `f32` this involves no double precision.
    fn single(value: f32) -> Self;
    /// Sine and cosine of an angle (rad). In `f32` the absolute error is below 1.2e-7 for |angle| < 1000.
    fn sine_cosine(self) -> (Self, Self);
    /// Angle of the point (`x`, `self`) (rad, -pi to pi); 0 for the origin. In `f32` the error is below 3e-7 rad.
    fn arctangent2(self, x: Self) -> Self;
    /// Non-negative square root; 0 for negative arguments.
    fn root(self) -> Self;
    /// Raises `self`, which must be positive, to the power `exponent`.
    fn power(self, exponent: Self) -> Self;
    /// Nearest integer, with halves rounded away from zero.
    fn nearest(self) -> Self;
    /// Returns whether the number is neither infinite nor NaN.
    fn finite(self) -> Self::SimdBool;
    /// The greater of two numbers; `other` if one of them is NaN.
    fn greater(self, other: Self) -> Self;
}

/// A scalar of the model: `f32` on the unit, `f64` for reference runs.
pub trait Real: Lanes + RealField {
    /// Returns the value in double precision.
    fn to_f64(self) -> f64;
}

impl Real for f64 {
    fn to_f64(self) -> f64 {
        self
    }
}

impl Real for f32 {
    fn to_f64(self) -> f64 {
        f64::from(self)
    }
}

impl Lanes for f64 {
    fn of(value: f64) -> Self {
        value
    }
    fn single(value: f32) -> Self {
        Self::from(value)
    }
    fn sine_cosine(self) -> (Self, Self) {
        libm::sincos(self)
    }
    fn arctangent2(self, x: Self) -> Self {
        libm::atan2(self, x)
    }
    fn root(self) -> Self {
        libm::sqrt(self.max(0.0))
    }
    fn power(self, exponent: Self) -> Self {
        libm::pow(self, exponent)
    }
    fn nearest(self) -> Self {
        libm::round(self)
    }
    fn finite(self) -> bool {
        self.is_finite()
    }
    fn greater(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
}

impl Lanes for f32 {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "rounding to single is the purpose"
    )]
    fn of(value: f64) -> Self {
        value as Self
    }
    fn single(value: f32) -> Self {
        value
    }
    fn sine_cosine(self) -> (Self, Self) {
        single_sine_cosine(self)
    }
    fn arctangent2(self, x: Self) -> Self {
        single_arctangent2(self, x)
    }
    fn root(self) -> Self {
        libm::sqrtf(self.max(0.0))
    }
    fn power(self, exponent: Self) -> Self {
        libm::powf(self, exponent)
    }
    fn nearest(self) -> Self {
        libm::roundf(self)
    }
    fn finite(self) -> bool {
        self.is_finite()
    }
    fn greater(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
}

/// Sine and cosine in single precision.
#[inline]
pub(crate) fn single_sine_cosine<T: Lanes>(angle: T) -> (T, T) {
    // Cody-Waite reduction to +-pi/4 with pi/2 in three parts, then minimax polynomials (Cephes sinf, cosf).
    let number = T::single;
    let quarter_turns = (angle * number(core::f32::consts::FRAC_2_PI)).nearest();
    let a = angle - quarter_turns * number(1.570_312_5);
    let a = a - quarter_turns * number(4.837_513e-4);
    let a = a - quarter_turns * number(7.549_79e-8);
    let square = a * a;
    let sine = a + a
        * square
        * (number(-1.666_665_5e-1)
            + square * (number(8.332_161e-3) + square * number(-1.951_529_6e-4)));
    let cosine = T::one() - number(0.5) * square
        + square
            * square
            * (number(4.166_664_6e-2)
                + square * (number(-1.388_731_6e-3) + square * number(2.443_315_7e-5)));
    let quadrant =
        quarter_turns - number(4.0) * (quarter_turns * number(0.25) - number(0.375)).nearest();
    // quadrant is 0, 1, 2 or 3, kept as a float so that large angles cause no integer overflow.
    let pair = quadrant.simd_lt(number(0.5)).if_else3(
        || Vector2::new(sine, cosine),
        (
            || quadrant.simd_lt(number(1.5)),
            || Vector2::new(cosine, -sine),
        ),
        (
            || quadrant.simd_lt(number(2.5)),
            || Vector2::new(-sine, -cosine),
        ),
        || Vector2::new(-cosine, sine),
    );
    (pair.x, pair.y)
}

/// Angle of the point (`x`, `y`) in single precision.
#[inline]
pub(crate) fn single_arctangent2<T: Lanes>(y: T, x: T) -> T {
    let number = T::single;
    let zero = T::zero();
    let (y_size, x_size) = (y.simd_abs(), x.simd_abs());
    let ordered = y_size.simd_lt(x_size).if_else(
        || Vector2::new(y_size, x_size),
        || Vector2::new(x_size, y_size),
    );
    let (small, large) = (ordered.x, ordered.y);
    large.simd_le(zero).if_else(
        || zero,
        || {
            // Reduce to |t| <= tan(pi/8), then a minimax polynomial (Cephes atanf).
            let ratio = small / large;
            let reduced = ratio.simd_gt(number(0.414_213_56)).if_else(
                || {
                    let t = (ratio - T::one()) / (ratio + T::one());
                    Vector2::new(number(core::f32::consts::FRAC_PI_4), t)
                },
                || Vector2::new(zero, ratio),
            );
            let (offset, t) = (reduced.x, reduced.y);
            let square = t * t;
            let polynomial = number(-3.333_295e-1)
                + square
                    * (number(1.997_771_1e-1)
                        + square * (number(-1.387_768_5e-1) + square * number(8.053_744_5e-2)));
            let angle = offset + (t + t * square * polynomial);
            let angle = y_size
                .simd_gt(x_size)
                .if_else(|| number(core::f32::consts::FRAC_PI_2) - angle, || angle);
            let angle = x
                .simd_lt(zero)
                .if_else(|| number(core::f32::consts::PI) - angle, || angle);
            y.simd_lt(zero).if_else(|| -angle, || angle)
        },
    )
}

/// Returns `usual` in the lanes where `condition` holds and `rare` elsewhere; `rare` is computed only if there is such a
/// lane.
#[inline(always)]
pub fn usually<R: SimdValue>(
    condition: R::SimdBool,
    usual: impl Fn() -> R,
    rare: impl Fn() -> R,
) -> R {
    if condition.all() {
        usual()
    } else {
        condition.if_else(usual, rare)
    }
}

/// Returns zero for a number too small to matter, before it becomes subnormal: processors differ in what they do with
/// those.
pub fn flushed<T: Real>(value: T) -> T {
    if value.abs() < T::of(1e-20) {
        T::zero()
    } else {
        value
    }
}

/// Arc sine (rad); arguments beyond +-1 are clamped.
pub fn arcsine<T: Real>(x: T) -> T {
    let x = clamp(x, -T::one(), T::one());
    x.arctangent2(((T::one() - x) * (T::one() + x)).root())
}

/// Limits `value` to `low..=high`; returns `low` if `value` is NaN.
pub fn clamp<T: Lanes>(value: T, low: T, high: T) -> T {
    value
        .simd_ge(high)
        .if_else2(|| high, (|| value.simd_gt(low), || value), || low)
}

/// Wraps an angle to -pi..=pi (rad) without a loop; returns 0 for arguments that are not finite.
pub fn wrap_angle<T: Real>(angle: T) -> T {
    if !angle.is_finite() {
        return T::zero();
    }
    angle - T::two_pi() * (angle / T::two_pi()).nearest()
}

/// Inverts a symmetric 3x3 matrix given by its lower triangle; returns `None` if it is singular or not finite.
pub fn inverse_symmetric<T: Real>(matrix: &Matrix3<T>) -> Option<Matrix3<T>> {
    let (inverse, exists) = adjugate_inverse(matrix);
    exists.then_some(inverse)
}

/// Inverts a symmetric positive definite 3x3 matrix given by its lower triangle; `otherwise` if it is singular or not
/// finite.
#[inline]
pub fn inverse_symmetric_or<T: Lanes>(
    matrix: &Matrix3<T>,
    otherwise: impl Fn() -> Matrix3<T>,
) -> Matrix3<T> {
    let (inverse, exists) = adjugate_inverse(matrix);
    usually(exists, || inverse, otherwise)
}

/// Solves `matrix * x = rhs` for a symmetric positive definite 3x3 matrix by its adjugate; `otherwise` if the matrix is
/// singular.
///
/// Reads only the lower triangle.
#[inline]
pub fn solve_symmetric_or<T: Lanes>(
    matrix: &Matrix3<T>,
    rhs: &Vector3<T>,
    otherwise: &Vector3<T>,
) -> Vector3<T> {
    let (inverse, exists) = adjugate_inverse(matrix);
    usually(exists, || inverse * rhs, || *otherwise)
}

/// Inverse of a symmetric 3x3 matrix, and whether it exists.
#[inline]
fn adjugate_inverse<T: Lanes>(matrix: &Matrix3<T>) -> (Matrix3<T>, T::SimdBool) {
    let (a, b, c) = (matrix.m11, matrix.m21, matrix.m31);
    let (d, e, f) = (matrix.m22, matrix.m32, matrix.m33);
    let (aa, bb, cc) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let determinant = a * aa + b * bb + c * cc;
    let inverse = T::one() / determinant;
    let (dd, ee, ff) = (a * f - c * c, b * c - a * e, a * d - b * b);
    let adjugate = Matrix3::new(aa, bb, cc, bb, dd, ee, cc, ee, ff);
    (adjugate * inverse, inverse.finite())
}

/// Rotation by the vector `angle` (rad), by the series of the exponential, without trigonometry.
///
/// The error is below 1e-9 rad up to 0.2 rad (48 rad/s for 1/240 s) and below 1e-6 rad up to 0.5 rad.
pub fn small_rotation<T: Lanes>(angle: &Vector3<T>) -> UnitQuaternion<T> {
    let square = angle.norm_squared();
    let cosine = T::one() - square * (T::of(1.0 / 8.0) - square * T::of(1.0 / 384.0));
    let half_sine = T::of(0.5) - square * (T::of(1.0 / 48.0) - square * T::of(1.0 / 3840.0));
    renormalized(nalgebra::Quaternion::from_parts(cosine, angle * half_sine))
}

/// Rotation by the vector `angle` (rad) of any length: exact, where [`small_rotation`] is a series.
pub fn rotation_by<T: Real>(angle: &Vector3<T>) -> UnitQuaternion<T> {
    let size = angle.norm_squared();
    if size < T::of(0.25) {
        return small_rotation(angle);
    }
    let size = size.root();
    let (sine, cosine) = (size * T::of(0.5)).sine_cosine();
    normalized(nalgebra::Quaternion::from_parts(
        cosine,
        angle * (sine / size),
    ))
}

/// Normalises a nearly unit quaternion, such as a product of unit quaternions, by one Newton step without root or
/// division. The norm is then 1 within 4e-9 plus rounding; quaternions further from unit norm are normalised in full.
#[inline]
pub fn renormalized<T: Lanes>(quaternion: nalgebra::Quaternion<T>) -> UnitQuaternion<T> {
    let excess = quaternion.coords.norm_squared() - T::one();
    usually(
        excess.simd_abs().simd_lt(T::of(1e-4)),
        || UnitQuaternion::new_unchecked(quaternion * (T::one() - T::of(0.5) * excess)),
        || normalized(quaternion),
    )
}

/// Normalises `quaternion`; returns the identity if its norm is zero.
#[inline]
pub fn normalized<T: Lanes>(quaternion: nalgebra::Quaternion<T>) -> UnitQuaternion<T> {
    let scale = T::one() / quaternion.coords.norm_squared().root();
    usually(
        scale.finite(),
        || UnitQuaternion::new_unchecked(quaternion * scale),
        UnitQuaternion::identity,
    )
}

/// Cross-product matrix: `skew(a) * b == a.cross(b)`.
pub fn skew<T: Lanes>(a: &Vector3<T>) -> Matrix3<T> {
    let zero = T::zero();
    Matrix3::new(zero, -a.z, a.y, a.z, zero, -a.x, -a.y, a.x, zero)
}

/// Product of the cross-product matrix of `a` with `matrix`: each column is multiplied by `a` from the left. It has the
/// bits of `skew(a) * matrix`, without the products with zero.
#[inline]
pub fn cross_columns<T: Lanes>(a: &Vector3<T>, matrix: &Matrix3<T>) -> Matrix3<T> {
    let column = |k: usize| a.cross(&matrix.column(k));
    Matrix3::from_columns(&[column(0), column(1), column(2)])
}

/// `factor * a a^T`.
pub fn outer<T: Lanes>(a: &Vector3<T>, factor: T) -> Matrix3<T> {
    let s = a * factor;
    Matrix3::new(
        s.x * a.x,
        s.x * a.y,
        s.x * a.z,
        s.y * a.x,
        s.y * a.y,
        s.y * a.z,
        s.z * a.x,
        s.z * a.y,
        s.z * a.z,
    )
}

/// Inertia of a point mass at `position` about the origin: `mass * (|r|^2 1 - r r^T)` (kg m2).
pub fn point_inertia<T: Lanes>(mass: T, position: &Vector3<T>) -> Matrix3<T> {
    Matrix3::from_diagonal_element(mass * position.norm_squared()) - outer(position, mass)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn single_precision_trigonometry_follows_double(angle in -1000.0f32..1000.0) {
            let (sine, cosine) = angle.sine_cosine();
            let (sine_64, cosine_64) = libm::sincos(f64::from(angle));
            prop_assert!((f64::from(sine) - sine_64).abs() < 2.0e-7, "sin {angle}");
            prop_assert!((f64::from(cosine) - cosine_64).abs() < 2.0e-7, "cos {angle}");
        }

        #[test]
        fn single_precision_arctangent_follows_double(y in -10.0f32..10.0, x in -10.0f32..10.0) {
            let error = f64::from(y.arctangent2(x)) - libm::atan2(f64::from(y), f64::from(x));
            prop_assert!(error.abs() < 3.0e-7, "{y} {x} {error}");
        }

        #[test]
        fn wrapping_keeps_the_direction(angle in -100.0f64..100.0) {
            let wrapped = wrap_angle(angle);
            prop_assert!(wrapped.abs() <= core::f64::consts::PI + 1e-12);
            prop_assert!((wrapped.sine_cosine().0 - angle.sine_cosine().0).abs() < 1e-12);
        }

        #[test]
        fn symmetric_inverse_undoes(v in prop::array::uniform6(-1.0f64..1.0)) {
            let lower = Matrix3::new(2.0 + v[0], 0.0, 0.0, v[1], 2.0 + v[2], 0.0, v[3], v[4], 2.0 + v[5]);
            let matrix = lower * lower.transpose();
            let inverse = inverse_symmetric(&matrix).unwrap();
            prop_assert!((matrix * inverse - Matrix3::identity()).abs().max() < 1e-9);
        }

        #[test]
        fn no_input_breaks_the_elementary_functions(bits in any::<u32>(), other in any::<u32>()) {
            let (a, b) = (f32::from_bits(bits), f32::from_bits(other));
            let _ = (a.sine_cosine(), a.arctangent2(b), a.root(), a.nearest());
            prop_assert!(wrap_angle(a).is_finite());
            prop_assert!(arcsine(a).is_finite());
        }
    }

    #[test]
    fn arctangent_covers_the_axes() {
        let half = core::f32::consts::FRAC_PI_2;
        assert!(0.0f32.arctangent2(0.0).abs() < 1e-9);
        assert!((1.0f32.arctangent2(0.0) - half).abs() < 1e-7);
        assert!(((-1.0f32).arctangent2(0.0) + half).abs() < 1e-7);
        assert!((0.0f32.arctangent2(-1.0) - core::f32::consts::PI).abs() < 1e-7);
    }

    #[test]
    fn small_rotations_follow_the_exponential() {
        for (size, limit) in [(0.03, 1e-12), (0.2, 1e-9), (0.5, 1e-6)] {
            let angle = Vector3::new(0.6, -0.48, 0.64) * size;
            let exact = rotation_by(&(angle * 9.0)).angle_to(&UnitQuaternion::new(angle * 9.0));
            assert!(exact < 1e-6, "{} rad: {exact}", 9.0 * size);
            let error = small_rotation(&angle).angle_to(&UnitQuaternion::new(angle));
            assert!(error < limit, "{size} rad: {error}");
        }
    }

    #[test]
    fn renormalising_is_normalising() {
        for scale in [0.0, 0.3, 0.99, 1.0 - 4e-5, 1.0, 1.0 + 4e-5, 1.01, f64::NAN] {
            let quaternion = nalgebra::Quaternion::new(0.5, -0.5, 0.5, 0.5) * scale;
            let (found, exact) = (renormalized(quaternion), normalized(quaternion));
            assert!((found.coords - exact.coords).norm() < 4e-9, "{scale}");
        }
    }

    #[test]
    fn a_singular_matrix_has_no_inverse() {
        assert!(inverse_symmetric(&Matrix3::<f32>::zeros()).is_none());
    }
}
