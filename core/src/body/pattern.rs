//! Standard postures and movement patterns, as data.
//!
//! A pattern moves several joints together in proportion to a single angle, the way skydivers learn it; the paper
//! gives the arch (eq. (arch_pat)). Joint angles are the paper's, about Z, Y, X (rad), see [`joint_rotation`].

use core::f64::consts::{FRAC_PI_2, FRAC_PI_8};

use nalgebra::UnitQuaternion;

use super::Segment;
use super::posture::{Posture, joint_rotation};
use crate::math::Real;

/// Joint angles (psi, theta, phi) of the segments whose angles are not all zero (rad).
pub type JointAngles = [(Segment, [f64; 3])];

/// Belly to earth: slight arch, upper arms straight out, elbows and knees bent, paper "The Trim Condition".
pub const NEUTRAL: &JointAngles = &[
    (Segment::Abdomen, [0.0, 0.0, 0.12]),
    (Segment::Thorax, [0.0, 0.0, 0.08]),
    (Segment::Head, [0.0, 0.0, 0.25]),
    (Segment::LeftUpperArm, [0.0, FRAC_PI_2, 0.0]),
    (Segment::LeftForearm, [0.0, FRAC_PI_2, 0.0]),
    (Segment::RightUpperArm, [0.0, -FRAC_PI_2, 0.0]),
    (Segment::RightForearm, [0.0, -FRAC_PI_2, 0.0]),
    (Segment::LeftThigh, [0.0, 0.25, -0.1]),
    (Segment::LeftShank, [0.0, 0.0, -1.0]),
    (Segment::LeftFoot, [0.0, 0.0, -0.6]),
    (Segment::RightThigh, [0.0, -0.25, -0.1]),
    (Segment::RightShank, [0.0, 0.0, -1.0]),
    (Segment::RightFoot, [0.0, 0.0, -0.6]),
];

/// Tracking, belly or back to earth: body straight, arms swept back at the sides, legs together.
pub const TRACK: &JointAngles = &[
    (Segment::Head, [0.0, 0.0, 0.1]),
    (Segment::LeftUpperArm, [0.0, 0.5, 0.0]),
    (Segment::RightUpperArm, [0.0, -0.5, 0.0]),
    (Segment::LeftThigh, [0.0, 0.12, 0.0]),
    (Segment::RightThigh, [0.0, -0.12, 0.0]),
    (Segment::LeftFoot, [0.0, 0.0, -0.8]),
    (Segment::RightFoot, [0.0, 0.0, -0.8]),
];

/// Sit: upright with a slight arch, thighs forward, shanks down, arms out, up and back, balanced under free-fly
/// aerodynamics.
pub const SIT: &JointAngles = &[
    (Segment::Abdomen, [0.0, 0.0, 0.1]),
    (Segment::Thorax, [0.0, 0.0, 0.07]),
    (Segment::LeftUpperArm, [0.0, 2.0, 0.6]),
    (Segment::LeftForearm, [0.0, 0.3, 0.0]),
    (Segment::RightUpperArm, [0.0, -2.0, 0.6]),
    (Segment::RightForearm, [0.0, -0.3, 0.0]),
    (Segment::LeftThigh, [0.0, 0.2, 1.09]),
    (Segment::LeftShank, [0.0, 0.0, -1.2]),
    (Segment::LeftFoot, [0.0, 0.0, -0.8]),
    (Segment::RightThigh, [0.0, -0.2, 1.09]),
    (Segment::RightShank, [0.0, 0.0, -1.2]),
    (Segment::RightFoot, [0.0, 0.0, -0.8]),
];

/// Head-down: straight trunk, arms out, legs apart and slightly behind the trunk, balanced under free-fly
/// aerodynamics.
pub const HEAD_DOWN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.9, 0.2]),
    (Segment::RightUpperArm, [0.0, -0.9, 0.2]),
    (Segment::LeftThigh, [0.0, 0.35, -0.22]),
    (Segment::RightThigh, [0.0, -0.35, -0.22]),
];

/// Back to earth: hips and knees bent, arms out and up.
pub const BACK: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, FRAC_PI_2, 0.2]),
    (Segment::LeftForearm, [0.0, 1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, -FRAC_PI_2, 0.2]),
    (Segment::RightForearm, [0.0, -1.0, 0.0]),
    (Segment::LeftThigh, [0.0, 0.25, 0.7]),
    (Segment::LeftShank, [0.0, 0.0, -0.8]),
    (Segment::RightThigh, [0.0, -0.25, 0.7]),
    (Segment::RightShank, [0.0, 0.0, -0.8]),
];

/// Arch, paper eq. (arch_pat): change of the joint angles per radian of the pattern.
///
/// Upper arms held straight out lie along the body's X axis, so the paper's shoulder angle theta swings them up and
/// down.
pub const ARCH: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, -1.0]),
    (Segment::RightThigh, [0.0, 0.0, -1.0]),
    (Segment::Abdomen, [0.0, 0.0, 1.0]),
    (Segment::Thorax, [0.0, 0.0, 2.0 / 3.0]),
    (Segment::Head, [0.0, 0.0, 4.0 / 5.0]),
    (Segment::RightUpperArm, [0.0, -2.0 / 3.0, 0.0]),
    (Segment::LeftUpperArm, [0.0, 2.0 / 3.0, 0.0]),
];

/// Draws the left arm in to the body.
pub const DRAW_IN_LEFT: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::LeftForearm, [0.0, -1.0, 0.0]),
];
/// Presses arms and thighs down into the airstream.
pub const PRESS: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, -1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];

/// Change from the neutral posture to one that is stable back to earth.
pub const TO_BACK: &JointAngles = &[
    (Segment::Abdomen, [0.0, 0.0, -0.12]),
    (Segment::Thorax, [0.0, 0.0, -0.08]),
    (Segment::LeftUpperArm, [0.0, 0.0, 0.2]),
    (Segment::RightUpperArm, [0.0, 0.0, 0.2]),
    (Segment::LeftThigh, [0.0, 0.0, 0.8]),
    (Segment::RightThigh, [0.0, 0.0, 0.8]),
    (Segment::LeftShank, [0.0, 0.0, 0.2]),
    (Segment::RightShank, [0.0, 0.0, 0.2]),
    (Segment::LeftFoot, [0.0, 0.0, 0.6]),
    (Segment::RightFoot, [0.0, 0.0, 0.6]),
];

/// One arm up, the other down: turns the body about the direction of the airstream.
pub const TURN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 0.5]),
    (Segment::RightUpperArm, [0.0, 0.0, -0.5]),
];
/// Bends trunk and limbs to one side.
pub const SIDE_BEND: &JointAngles = &[
    (Segment::Abdomen, [0.0, 0.8, 0.0]),
    (Segment::Thorax, [0.0, 0.8, 0.0]),
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, -1.0, 0.0]),
    (Segment::LeftThigh, [0.0, -1.0, 0.0]),
    (Segment::RightThigh, [0.0, -1.0, 0.0]),
];
/// Stretches the legs: lowers the head and drives the body forwards.
pub const STRETCH: &JointAngles = &[
    (Segment::LeftShank, [0.0, 0.0, 1.0]),
    (Segment::RightShank, [0.0, 0.0, 1.0]),
];
/// Rotates both shoulders inwards, so that the bent forearms go down into the airstream.
pub const ARMS_DOWN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, -1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];

/// Drag factor that the paper assigns to an arch angle (rad), first line of eq. (arch_pat).
pub fn arch_line<T: Real>(angle: T) -> T {
    T::one() - angle * T::of(0.2 / FRAC_PI_8)
}

/// Builds a posture from a table of joint angles.
pub fn posture<T: Real>(angles: &JointAngles) -> Posture<T> {
    angles
        .iter()
        .fold(Posture::h_pose(), |posture, &(segment, angles)| {
            posture.with(segment, rotation(angles, T::one()))
        })
}

/// Returns the neutral posture, see [`NEUTRAL`].
pub fn neutral<T: Real>() -> Posture<T> {
    posture(NEUTRAL)
}

/// Adds `amount` times the changes of `pattern` to `posture`, each in the axes of the joint's parent.
#[must_use]
pub fn moved<T: Real>(posture: &Posture<T>, pattern: &JointAngles, amount: T) -> Posture<T> {
    pattern
        .iter()
        .fold(*posture, |posture, &(segment, angles)| {
            posture.with(
                segment,
                rotation(angles, amount) * posture.parent_from_segment(segment),
            )
        })
}

/// Arches `posture` by `angle` (rad), see [`ARCH`].
#[must_use]
pub fn arched<T: Real>(posture: &Posture<T>, angle: T) -> Posture<T> {
    moved(posture, ARCH, angle)
}

fn rotation<T: Real>(angles: [f64; 3], amount: T) -> UnitQuaternion<T> {
    let [psi, theta, phi] = angles.map(|angle| T::of(angle) * amount);
    joint_rotation(psi, theta, phi)
}
