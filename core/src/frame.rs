//! Frames of reference, and rotations and vectors typed by their frame.
//!
//! One convention holds throughout. A rotation is active and named after what it does to components,
//! `inertial_from_body * vector_in_body = vector_in_inertial`, so adjacent frame names match in a product:
//! `inertial_from_body * body_from_segment * segment_from_point`. Mixing frames does not compile:
//!
//! ```compile_fail
//! use bodyflight_core::frame::{Body, Inertial, Rotation, Vector};
//! let inertial_from_body = Rotation::<f32, Inertial, Body>::identity();
//! let gravity = Vector::<f32, Inertial>::new(0.0, 0.0, -9.81);
//! let wrong = inertial_from_body * gravity;
//! ```
//!
//! The types have no run-time cost. A function that works in a single frame may use plain nalgebra vectors and name
//! the frame in its documentation.

mod axes;
mod rotation;
mod vector;

use nalgebra::{Quaternion, SimdBool, UnitQuaternion, Vector3};

use crate::math::{self, Lanes, Real};
pub use axes::{Body, Inertial, SegmentFrame, XsensSegment};
pub use rotation::{Rotation, RotationMatrix};
pub use vector::Vector;

/// Heading, pitch and roll of the body as the paper defines them, eqs. (xyz) and (ypr).
///
/// Heading and pitch are those of the cranial axis. Roll is 0 when belly to earth with a level left-right axis and
/// stays continuous up to the back-to-earth pose.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Deserialize, serde::Serialize))]
pub struct AttitudeAngles<T> {
    /// Direction of the cranial axis over the ground, from north towards west (rad).
    pub heading: T,
    /// Elevation of the cranial axis above the horizon (rad).
    pub pitch: T,
    /// Elevation of the left axis, from -pi/2 to 3 pi/2 (rad): beyond pi/2 when the back faces the earth, pi when back
    /// to earth and level.
    pub roll: T,
}

impl<T: Lanes> AttitudeAngles<T> {
    /// Computes the angles of an attitude, paper eqs. (xyz) and (ypr).
    pub fn of(inertial_from_body: &Rotation<T, Inertial, Body>) -> Self {
        let matrix = inertial_from_body.quaternion().to_rotation_matrix();
        let axes = matrix.matrix();
        // The rotation q_z of paper eq. (xyz) undoes the rotation of the paper's inertial frame, so it is not needed
        // here.
        let level = |column: usize| (axes[(0, column)], axes[(1, column)], axes[(2, column)]);
        let (left_x, left_y, left_up) = level(0);
        let back_up = axes[(2, 1)];
        let (head_x, head_y, head_up) = level(2);
        let horizontal = |x: T, y: T| (x * x + y * y).root();
        let tilt = left_up.arctangent2(horizontal(left_x, left_y));
        let roll = back_up
            .simd_lt(T::zero())
            .if_else(|| T::simd_pi() - tilt, || tilt);
        Self {
            heading: head_y.arctangent2(head_x),
            pitch: head_up.arctangent2(horizontal(head_x, head_y)),
            roll,
        }
    }
}

/// Attitude of a body that faces north, pitched forwards about its left axis by `pitch` (rad): 0 is upright, pi/2 is
/// belly to earth with the head to the north.
pub fn facing_north<T: Real>(pitch: T) -> Rotation<T, Inertial, Body> {
    let half = T::of(core::f64::consts::FRAC_1_SQRT_2);
    let to_north = UnitQuaternion::new_unchecked(Quaternion::new(half, T::zero(), T::zero(), half));
    Rotation::from_quaternion(to_north * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch))
}

/// Returns the Euler angles yaw, pitch and roll of an attitude (rad), paper eq. (euler), using `atan2` to resolve the
/// quadrants.
///
/// The paper's quaternion follows MATLAB's passive convention; in the active convention used here its components are
/// those of `inertial_from_body`.
pub fn euler_angles<T: Real>(inertial_from_body: &Rotation<T, Inertial, Body>) -> [T; 3] {
    let [w, x, y, z] = inertial_from_body.wxyz();
    let (one, two) = (T::one(), T::of(2.0));
    [
        (two * (w * z + x * y)).arctangent2(one - two * (y * y + z * z)),
        math::arcsine(two * (w * y - x * z)),
        (two * (w * x + y * z)).arctangent2(one - two * (x * x + y * y)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn euler_angles_are_those_of_the_paper(yaw in -3.1f64..3.1, pitch in -1.5f64..1.5, roll in -3.1f64..3.1) {
            let turn = |axis, angle| UnitQuaternion::from_axis_angle(&axis, angle);
            let quaternion = turn(Vector3::z_axis(), yaw)
                * turn(Vector3::y_axis(), pitch)
                * turn(Vector3::x_axis(), roll);
            let found = euler_angles(&Rotation::from_quaternion(quaternion));
            for (found, expected) in found.into_iter().zip([yaw, pitch, roll]) {
                prop_assert!((found - expected).abs() < 1e-9, "{found} {expected}");
            }
        }

        #[test]
        fn rotations_undo_and_keep_length(q in prop::array::uniform4(-1.0f64..1.0), v in prop::array::uniform3(-9.0f64..9.0)) {
            let Some(inertial_from_body) = Rotation::<f64, Inertial, Body>::from_wxyz(q) else {
                return Ok(());
            };
            let vector = Vector::<f64, Body>::from_components(v.into());
            let back = inertial_from_body.inverse() * (inertial_from_body * vector);
            prop_assert!((back - vector).norm() < 1e-12);
            let matrix = inertial_from_body.to_matrix();
            prop_assert!((&matrix * vector - inertial_from_body * vector).norm() < 1e-12);
            prop_assert!((&matrix.inverse() * (&matrix * vector) - vector).norm() < 1e-12);
        }
    }

    #[test]
    fn numbers_without_direction_are_not_a_rotation() {
        for wxyz in [
            [0.0; 4],
            [f32::NAN, 0.0, 0.0, 1.0],
            [f32::INFINITY, 0.0, 0.0, 1.0],
        ] {
            assert!(Rotation::<f32, Inertial, Body>::from_wxyz(wxyz).is_none());
        }
    }

    /// Distinguishes north, west and up, so that an error of a quarter turn cannot go unnoticed.
    #[test]
    fn headings_run_from_north_towards_west() {
        let belly = facing_north(core::f64::consts::FRAC_PI_2);
        let head = belly * Vector::new(0.0, 0.0, 1.0);
        assert!((head - Vector::new(1.0, 0.0, 0.0)).norm() < 1e-12, "north");
        let left = belly * Vector::new(1.0, 0.0, 0.0);
        assert!((left - Vector::new(0.0, 1.0, 0.0)).norm() < 1e-12, "west");
        assert!(AttitudeAngles::of(&belly).heading.abs() < 1e-12);
        let upright = facing_north(0.0) * Vector::<f64, Body>::new(0.0, -1.0, 0.0);
        assert!((upright - Vector::new(1.0, 0.0, 0.0)).norm() < 1e-12);
        for turn in [-2.0, -0.5, 0.4, 3.0] {
            let turned = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn);
            let turned = Rotation::<f64, Inertial, Inertial>::from_quaternion(turned);
            let heading = AttitudeAngles::of(&(turned * belly)).heading;
            assert!((heading - turn).abs() < 1e-12, "{turn}: {heading}");
        }
    }

    #[test]
    fn roll_passes_through_a_quarter_turn_without_a_jump() {
        let belly =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::FRAC_PI_2);
        let mut last = 0.0;
        for k in 1..=300 {
            let angle = 0.01 * f64::from(k);
            let lean = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), -angle);
            let roll = AttitudeAngles::of(&Rotation::from_quaternion(lean * belly)).roll;
            // The head points along inertial -Y, so leaning about that axis is roll.
            assert!((roll.abs() - angle).abs() < 1e-9, "{angle}: {roll}");
            assert!((roll - last).abs() < 0.011);
            last = roll;
        }
    }
}
