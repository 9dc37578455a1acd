//! Vectors typed by their frame.

use core::iter::Sum;
use core::marker::PhantomData;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use nalgebra::{Matrix3, Vector3};

use super::axes::Inertial;
use crate::math::{Lanes, Real};

/// A vector given by its components in frame `F`.
///
/// Vectors of one frame can be added, scaled and multiplied with each other; vectors of different frames must first be
/// brought to a common frame by a [`Rotation`](super::Rotation). Every operation is nalgebra's on the components, bit
/// for bit.
pub struct Vector<T: Lanes, F> {
    /// Components along the axes of `F`, for code that does not use frame types, such as files and matrices.
    pub components: Vector3<T>,
    frame: PhantomData<fn() -> F>,
}

impl<T: Lanes, F> Vector<T, F> {
    /// Creates a vector from components along the axes of `F`.
    #[inline]
    pub fn new(x: T, y: T, z: T) -> Self {
        Self::from_components(Vector3::new(x, y, z))
    }

    /// Declares that `components` are along the axes of `F`; this is where untyped values enter the type system.
    #[inline]
    pub const fn from_components(components: Vector3<T>) -> Self {
        Self {
            components,
            frame: PhantomData,
        }
    }

    /// Returns the zero vector.
    #[inline]
    pub fn zero() -> Self {
        Self::from_components(Vector3::zeros())
    }

    /// Component along the X axis.
    #[inline]
    pub fn x(&self) -> T {
        self.components.x
    }

    /// Component along the Y axis.
    #[inline]
    pub fn y(&self) -> T {
        self.components.y
    }

    /// Component along the Z axis.
    #[inline]
    pub fn z(&self) -> T {
        self.components.z
    }

    /// Returns the components along X, Y and Z.
    #[inline]
    pub fn to_array(self) -> [T; 3] {
        self.components.into()
    }

    /// Scalar (dot) product.
    #[inline]
    pub fn dot(&self, other: &Self) -> T {
        self.components.dot(&other.components)
    }

    /// Vector (cross) product.
    #[inline]
    pub fn cross(&self, other: &Self) -> Self {
        Self::from_components(self.components.cross(&other.components))
    }

    /// Squared length.
    #[inline]
    pub fn norm_squared(&self) -> T {
        self.components.norm_squared()
    }

    /// Length.
    #[inline]
    pub fn norm(&self) -> T {
        self.norm_squared().root()
    }

    /// Multiplies each component by the factor for its axis.
    #[inline]
    pub fn component_mul(&self, factors: &Vector3<T>) -> Self {
        Self::from_components(self.components.component_mul(factors))
    }

    /// Applies `change` to each component.
    #[inline]
    pub fn map(&self, change: impl FnMut(T) -> T) -> Self {
        Self::from_components(self.components.map(change))
    }

    /// Interpolates linearly towards `other` by `share`; shares outside 0 to 1 extrapolate.
    #[inline]
    pub fn towards(&self, other: &Self, share: T) -> Self {
        *self + (*other - *self) * share
    }

    /// Returns whether every component is finite.
    #[inline]
    pub fn is_finite(&self) -> bool
    where
        T: Real,
    {
        self.components.iter().all(|c| c.is_finite())
    }

    /// Converts the vector to another precision.
    pub fn cast<U: Lanes>(&self) -> Vector<U, F>
    where
        T: Real,
    {
        Vector::from_components(self.components.map(|c| U::of(c.to_f64())))
    }
}

impl<T: Lanes> Vector<T, Inertial> {
    /// Northward component.
    #[inline]
    pub fn north(&self) -> T {
        self.components.x
    }

    /// Westward component.
    #[inline]
    pub fn west(&self) -> T {
        self.components.y
    }

    /// Upward component.
    #[inline]
    pub fn up(&self) -> T {
        self.components.z
    }
}

impl<T: Lanes, F> From<[T; 3]> for Vector<T, F> {
    fn from(components: [T; 3]) -> Self {
        Self::from_components(components.into())
    }
}

impl<T: Lanes, F> Add for Vector<T, F> {
    type Output = Self;
    #[inline]
    fn add(self, rhs: Self) -> Self {
        Self::from_components(self.components + rhs.components)
    }
}

impl<T: Lanes, F> Sub for Vector<T, F> {
    type Output = Self;
    #[inline]
    fn sub(self, rhs: Self) -> Self {
        Self::from_components(self.components - rhs.components)
    }
}

impl<T: Lanes, F> Neg for Vector<T, F> {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self::from_components(-self.components)
    }
}

impl<T: Lanes, F> Mul<T> for Vector<T, F> {
    type Output = Self;
    #[inline]
    fn mul(self, rhs: T) -> Self {
        Self::from_components(self.components * rhs)
    }
}

impl<T: Lanes, F> Div<T> for Vector<T, F> {
    type Output = Self;
    #[inline]
    fn div(self, rhs: T) -> Self {
        Self::from_components(self.components / rhs)
    }
}

impl<T: Lanes, F> AddAssign for Vector<T, F> {
    #[inline]
    fn add_assign(&mut self, rhs: Self) {
        self.components += rhs.components;
    }
}

impl<T: Lanes, F> SubAssign for Vector<T, F> {
    #[inline]
    fn sub_assign(&mut self, rhs: Self) {
        self.components -= rhs.components;
    }
}

impl<T: Lanes, F> MulAssign<T> for Vector<T, F> {
    #[inline]
    fn mul_assign(&mut self, rhs: T) {
        self.components *= rhs;
    }
}

impl<T: Lanes, F> DivAssign<T> for Vector<T, F> {
    #[inline]
    fn div_assign(&mut self, rhs: T) {
        self.components /= rhs;
    }
}

impl<T: Lanes, F> Sum for Vector<T, F> {
    fn sum<I: Iterator<Item = Self>>(vectors: I) -> Self {
        vectors.fold(Self::zero(), |sum, vector| sum + vector)
    }
}

/// Product with a tensor given along the axes of the same frame.
impl<T: Lanes, F> Mul<Vector<T, F>> for &Matrix3<T> {
    type Output = Vector<T, F>;
    #[inline]
    fn mul(self, rhs: Vector<T, F>) -> Self::Output {
        Vector::from_components(self * rhs.components)
    }
}

// Derived impls would require Copy, Debug and so on from the frame types.
impl<T: Lanes, F> Clone for Vector<T, F> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Lanes, F> Copy for Vector<T, F> {}
impl<T: Lanes, F> PartialEq for Vector<T, F> {
    fn eq(&self, other: &Self) -> bool {
        self.components == other.components
    }
}
impl<T: Lanes, F> core::fmt::Debug for Vector<T, F> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let c = &self.components;
        write!(f, "Vector[{:?}, {:?}, {:?}]", c.x, c.y, c.z)
    }
}

#[cfg(test)]
mod tests {
    use super::super::axes::Body;
    use super::*;
    use proptest::prelude::*;

    type BodyVector = Vector<f32, Body>;

    proptest! {
        #[test]
        fn operations_have_the_bits_of_their_components(
            a in prop::array::uniform3(-9.0f32..9.0),
            b in prop::array::uniform3(-9.0f32..9.0),
            k in 0.1f32..9.0,
        ) {
            let (u, v) = (Vector3::from(a), Vector3::from(b));
            let (a, b) = (BodyVector::from(a), BodyVector::from(b));
            prop_assert_eq!((a + b).components, u + v);
            prop_assert_eq!((a - b).components, u - v);
            prop_assert_eq!((-a).components, -u);
            prop_assert_eq!((a * k).components, u * k);
            prop_assert_eq!((a / k).components, u / k);
            prop_assert_eq!(a.cross(&b).components, u.cross(&v));
            prop_assert_eq!(a.dot(&b).to_bits(), u.dot(&v).to_bits());
            prop_assert_eq!(a.norm().to_bits(), u.norm().to_bits());
            prop_assert_eq!(a.towards(&b, k).components, u + (v - u) * k);
            let mut c = a;
            c += b;
            c -= a;
            c *= k;
            c /= k;
            prop_assert_eq!(c.components, (u + v - u) * k / k);
            prop_assert_eq!([a, b].into_iter().sum::<BodyVector>(), a + b);
        }
    }
}
