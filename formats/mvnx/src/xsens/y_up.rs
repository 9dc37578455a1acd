//! Poses of the MVN network stream in axes with Y up, centimetres and degrees (kind 01).
//!
//! The axes are those of MVN in cyclic order: X, Y, Z here are MVN's Y, Z, X. A cyclic permutation is a rotation, so
//! orientations permute the components of their axis the same way.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// A position (cm, Y up) in the global frame of MVN (m, Z up).
pub fn position(centimetres: Vector3<f64>) -> Vector3<f64> {
    Vector3::new(centimetres.z, centimetres.x, centimetres.y) / 100.0
}

/// An orientation as angles about X, Y and Z (deg, Y up), applied in this order about fixed axes.
pub fn orientation(degrees: Vector3<f64>) -> UnitQuaternion<f64> {
    let [x, y, z] = degrees.map(f64::to_radians).into();
    let q = UnitQuaternion::from_euler_angles(x, y, z);
    UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.k, q.i, q.j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Global axes of MVN to those with Y up.
    fn y_up(v: Vector3<f64>) -> Vector3<f64> {
        Vector3::new(v.y, v.z, v.x)
    }

    #[test]
    fn height_is_the_second_component() {
        let standing = position(Vector3::new(41.0, 105.0, 7.0));
        assert!((standing - Vector3::new(0.07, 0.41, 1.05)).norm() < 1e-12);
        // About the vertical, forward turns to the left.
        let turned = orientation(Vector3::new(0.0, 90.0, 0.0)) * Vector3::x();
        assert!((turned - Vector3::y()).norm() < 1e-12);
    }

    proptest! {
        #[test]
        fn turning_is_the_same_in_both_axes(
            angles in prop::array::uniform3(-180.0f64..180.0),
            arm in prop::array::uniform3(-2.0f64..2.0),
        ) {
            let [x, y, z] = angles.map(f64::to_radians);
            let arm = Vector3::from(arm);
            let about = |axis: Vector3<f64>, angle| {
                UnitQuaternion::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle)
            };
            let expected = about(Vector3::z(), z)
                * (about(Vector3::y(), y) * (about(Vector3::x(), x) * y_up(arm)));
            let found = y_up(orientation(Vector3::from(angles)) * arm);
            prop_assert!((found - expected).norm() < 1e-12);
        }
    }
}
