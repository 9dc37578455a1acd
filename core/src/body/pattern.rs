//! Standard postures and movement patterns, as data.
//!
//! A pattern moves several joints together by one angle, as a skydiver learns it; the paper gives the arch
//! (eq. (arch_pat)). Angles are the paper's, about Z, Y, X (rad), see
//! [`joint_rotation`].

use core::f64::consts::{FRAC_PI_2, FRAC_PI_8};

use nalgebra::UnitQuaternion;

use super::Segment;
use super::posture::{Posture, joint_rotation};
use crate::math::Real;

/// Joint angles (psi, theta, phi) of the segments that differ from zero (rad).
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

/// Tracking, belly or back to earth: straight, arms swept back beside the body, legs together.
pub const TRACK: &JointAngles = &[
    (Segment::Head, [0.0, 0.0, 0.1]),
    (Segment::LeftUpperArm, [0.0, 0.5, 0.0]),
    (Segment::RightUpperArm, [0.0, -0.5, 0.0]),
    (Segment::LeftThigh, [0.0, 0.12, 0.0]),
    (Segment::RightThigh, [0.0, -0.12, 0.0]),
    (Segment::LeftFoot, [0.0, 0.0, -0.8]),
    (Segment::RightFoot, [0.0, 0.0, -0.8]),
];

/// Sit: upright, slightly arched, thighs forward and shanks down, arms out, up and back, where free-fly aerodynamics balance it.
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

/// Head-down: straight trunk, arms out, legs apart and a little behind the trunk, where free-fly aerodynamics balance it.
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

/// Arch, paper eq. (arch_pat): changes of the joint angles for one radian of the pattern.
///
/// Upper arms straight out point along the body's X, so the paper's shoulder angle theta swings them up
/// and down about it.
pub const ARCH: &JointAngles = &[
    (Segment::LeftThigh, [0.0, 0.0, -1.0]),
    (Segment::RightThigh, [0.0, 0.0, -1.0]),
    (Segment::Abdomen, [0.0, 0.0, 1.0]),
    (Segment::Thorax, [0.0, 0.0, 2.0 / 3.0]),
    (Segment::Head, [0.0, 0.0, 4.0 / 5.0]),
    (Segment::RightUpperArm, [0.0, -2.0 / 3.0, 0.0]),
    (Segment::LeftUpperArm, [0.0, 2.0 / 3.0, 0.0]),
];

/// The left arm drawn in to the body.
pub const DRAW_IN_LEFT: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::LeftForearm, [0.0, -1.0, 0.0]),
];
/// Arms and thighs pressed down into the stream.
pub const PRESS: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, -1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
    (Segment::LeftThigh, [0.0, 0.0, 1.0]),
    (Segment::RightThigh, [0.0, 0.0, 1.0]),
];

/// Changes from the neutral posture to one that is stable back to earth.
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

/// One arm up, the other down: turns about the stream.
pub const TURN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, 0.5]),
    (Segment::RightUpperArm, [0.0, 0.0, -0.5]),
];
/// Trunk and limbs bent to one side.
pub const SIDE_BEND: &JointAngles = &[
    (Segment::Abdomen, [0.0, 0.8, 0.0]),
    (Segment::Thorax, [0.0, 0.8, 0.0]),
    (Segment::LeftUpperArm, [0.0, -1.0, 0.0]),
    (Segment::RightUpperArm, [0.0, -1.0, 0.0]),
    (Segment::LeftThigh, [0.0, -1.0, 0.0]),
    (Segment::RightThigh, [0.0, -1.0, 0.0]),
];
/// Legs stretched: head-low, forwards.
pub const STRETCH: &JointAngles = &[
    (Segment::LeftShank, [0.0, 0.0, 1.0]),
    (Segment::RightShank, [0.0, 0.0, 1.0]),
];
/// Both shoulders turned inwards: bent arms go down into the stream.
pub const ARMS_DOWN: &JointAngles = &[
    (Segment::LeftUpperArm, [0.0, 0.0, -1.0]),
    (Segment::RightUpperArm, [0.0, 0.0, -1.0]),
];

/// Drag factor that the paper assigns to an arch angle (rad), first line of eq. (arch_pat).
pub fn arch_line<T: Real>(angle: T) -> T {
    T::one() - angle * T::of(0.2 / FRAC_PI_8)
}

/// The posture of a table of joint angles.
pub fn posture<T: Real>(angles: &JointAngles) -> Posture<T> {
    angles
        .iter()
        .fold(Posture::h_pose(), |posture, &(segment, angles)| {
            posture.with(segment, rotation(angles, T::one()))
        })
}

/// The neutral posture, see [`NEUTRAL`].
pub fn neutral<T: Real>() -> Posture<T> {
    posture(NEUTRAL)
}

/// `posture` with the changes of `pattern` times `amount` added, each in the axes of the joint's parent.
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

/// `posture` arched by `angle` (rad), see [`ARCH`].
#[must_use]
pub fn arched<T: Real>(posture: &Posture<T>, angle: T) -> Posture<T> {
    moved(posture, ARCH, angle)
}

fn rotation<T: Real>(angles: [f64; 3], amount: T) -> UnitQuaternion<T> {
    let [psi, theta, phi] = angles.map(|angle| T::of(angle) * amount);
    joint_rotation(psi, theta, phi)
}
