//! Rotations from one frame to another.

use core::marker::PhantomData;
use core::ops::Mul;

use nalgebra::{Matrix3, Quaternion, UnitQuaternion};

use super::vector::Vector;
use crate::math::{self, Lanes, Real};

/// Rotation that converts components in `From` to components in `To`.
pub struct Rotation<T: Lanes, To, From> {
    quaternion: UnitQuaternion<T>,
    frames: PhantomData<fn(From) -> To>,
}

impl<T: Lanes, To, From> Rotation<T, To, From> {
    /// Returns the identity: both frames coincide.
    pub fn identity() -> Self {
        Self::from_quaternion(UnitQuaternion::identity())
    }

    /// Declares that `quaternion` converts components from `From` to `To`; this is where untyped values enter the type
    /// system.
    pub fn from_quaternion(quaternion: UnitQuaternion<T>) -> Self {
        Self {
            quaternion,
            frames: PhantomData,
        }
    }

    /// Creates a rotation from w, x, y, z of any norm; returns `None` if the norm is close to zero or not finite.
    pub fn from_wxyz(wxyz: [T; 4]) -> Option<Self>
    where
        T: Real,
    {
        let quaternion = Quaternion::new(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
        let size = quaternion.coords.norm_squared();
        (size.is_finite() && size > T::of(1e-12))
            .then(|| Self::from_quaternion(math::normalized(quaternion)))
    }

    /// Returns the untyped quaternion.
    pub fn quaternion(&self) -> &UnitQuaternion<T> {
        &self.quaternion
    }

    /// Returns the components w, x, y, z.
    pub fn wxyz(&self) -> [T; 4] {
        let q = &self.quaternion;
        [q.w, q.i, q.j, q.k]
    }

    /// Returns the inverse rotation.
    pub fn inverse(&self) -> Rotation<T, From, To> {
        Rotation::from_quaternion(self.quaternion.inverse())
    }

    /// Converts the rotation to another precision.
    pub fn cast<U: Lanes>(&self) -> Rotation<U, To, From>
    where
        T: Real,
    {
        Rotation::from_quaternion(math::normalized(
            self.quaternion.coords.map(|c| U::of(c.to_f64())).into(),
        ))
    }
}

impl<T: Lanes, To, From> Rotation<T, To, From> {
    /// Returns the same rotation as a matrix, which rotates several vectors faster.
    #[inline]
    pub fn to_matrix(&self) -> RotationMatrix<T, To, From> {
        RotationMatrix {
            matrix: self.quaternion.to_rotation_matrix().into_inner(),
            frames: PhantomData,
        }
    }
}

/// A [`Rotation`] in matrix form.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RotationMatrix<T: Lanes, To, From> {
    matrix: Matrix3<T>,
    frames: PhantomData<fn(From) -> To>,
}

impl<T: Lanes, To, From> RotationMatrix<T, To, From> {
    /// Returns the matrix without its frames.
    #[inline]
    pub fn matrix(&self) -> &Matrix3<T> {
        &self.matrix
    }

    /// Returns the inverse rotation.
    #[inline]
    pub fn inverse(&self) -> RotationMatrix<T, From, To> {
        RotationMatrix {
            matrix: self.matrix.transpose(),
            frames: PhantomData,
        }
    }
}

impl<T: Lanes, To, From> Mul<Vector<T, From>> for &RotationMatrix<T, To, From> {
    type Output = Vector<T, To>;
    #[inline]
    fn mul(self, rhs: Vector<T, From>) -> Self::Output {
        Vector::from_components(self.matrix * rhs.components)
    }
}

impl<T: Lanes, To, Via, From> Mul<Rotation<T, Via, From>> for Rotation<T, To, Via> {
    type Output = Rotation<T, To, From>;
    fn mul(self, rhs: Rotation<T, Via, From>) -> Self::Output {
        Rotation::from_quaternion(self.quaternion * rhs.quaternion)
    }
}

impl<T: Lanes, To, From> Mul<Vector<T, From>> for Rotation<T, To, From> {
    type Output = Vector<T, To>;
    fn mul(self, rhs: Vector<T, From>) -> Self::Output {
        Vector::from_components(self.quaternion * rhs.components)
    }
}

// Derived impls would require Copy, Debug and so on from the frame types.
impl<T: Lanes, To, From> Clone for Rotation<T, To, From> {
    fn clone(&self) -> Self {
        *self
    }
}
impl<T: Lanes, To, From> Copy for Rotation<T, To, From> {}
impl<T: Lanes, To, From> PartialEq for Rotation<T, To, From> {
    fn eq(&self, other: &Self) -> bool {
        self.quaternion.coords == other.quaternion.coords
    }
}
impl<T: Lanes, To, From> core::fmt::Debug for Rotation<T, To, From> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "Rotation{:?}", self.wxyz())
    }
}
