//! Samples: posture and pelvis motion in 111 bytes; this module is the only place where quantisation happens.

use nalgebra::{UnitQuaternion, Vector3};

use super::flags::Validity;
use super::message::Sample;
use super::packed_quaternion::{PackedQuaternion, whole};
use crate::body::posture::Posture;
use crate::body::{SEGMENT_COUNT, Segment};
use crate::frame::{Body, Inertial, Rotation, Vector};

const ANGULAR_VELOCITY_COUNTS: f32 = 1024.0;
const SPEED_COUNTS: f32 = 256.0;

/// Motion of the pelvis; `None` for a quantity that was not measured.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Angular velocity relative to the inertial frame, in body axes (rad/s), each component below 32.
    pub angular_velocity: Option<Vector<f32, Body>>,
    /// Velocity relative to the inertial frame (m/s), each component below 128.
    pub velocity: Option<Vector<f32, Inertial>>,
    /// Horizontal speed from GNSS (m/s), below 256.
    pub horizontal_speed: Option<f32>,
}

impl Sample {
    /// Quantises a posture, an attitude and a motion.
    ///
    /// Values that are not finite or out of scale are marked as absent, so that a receiver never sees a value that was
    /// not measured.
    pub fn new(
        posture: &Posture<f32>,
        inertial_from_body: &Rotation<f32, Inertial, Body>,
        motion: &Motion,
    ) -> Self {
        let mut sample = Self {
            valid: Validity::default(),
            rotations: [PackedQuaternion::default(); SEGMENT_COUNT],
            angular_velocity: [0; 3],
            velocity: [0; 3],
            horizontal_speed: 0,
        };
        let attitude = inertial_from_body.quaternion();
        let (with_posture, with_attitude) = (posture.is_valid(), is_unit(attitude));
        for (packed, segment) in sample.rotations.iter_mut().zip(Segment::ALL) {
            match segment {
                Segment::Pelvis if with_attitude => *packed = PackedQuaternion::pack(attitude),
                Segment::Pelvis => {}
                _ if with_posture => {
                    *packed = PackedQuaternion::pack(posture.parent_from_segment(segment));
                }
                _ => {}
            }
        }
        sample.valid.set(Validity::POSTURE, with_posture);
        sample.valid.set(Validity::ATTITUDE, with_attitude);
        let measured = motion.angular_velocity.map(|v| v.components);
        if let Some(counts) = counts_of(measured, ANGULAR_VELOCITY_COUNTS) {
            sample.angular_velocity = counts;
            sample.valid |= Validity::ANGULAR_VELOCITY;
        }
        let measured = motion.velocity.map(|v| v.components);
        if let Some(counts) = counts_of(measured, SPEED_COUNTS) {
            sample.velocity = counts;
            sample.valid |= Validity::VELOCITY;
        }
        let counts = motion
            .horizontal_speed
            .filter(|speed| (0.0..255.99).contains(speed))
            .and_then(|speed| u16::try_from(whole(speed * SPEED_COUNTS)).ok());
        if let Some(counts) = counts {
            sample.horizontal_speed = counts;
            sample.valid |= Validity::HORIZONTAL_SPEED;
        }
        sample
    }

    /// Returns the posture, or the H-pose if it is not valid.
    pub fn posture(&self) -> Posture<f32> {
        let mut posture = Posture::h_pose();
        for (segment, packed) in Segment::ALL.into_iter().zip(self.rotations) {
            posture.set(segment, packed.unpack());
        }
        posture
    }

    /// Returns the attitude of the pelvis, or the identity if it is not valid.
    pub fn inertial_from_body(&self) -> Rotation<f32, Inertial, Body> {
        let [attitude, ..] = self.rotations;
        Rotation::from_quaternion(attitude.unpack())
    }

    /// Returns the motion of the pelvis.
    pub fn motion(&self) -> Motion {
        let vector = |counts: [i16; 3], part: Validity, scale: f32| {
            self.valid
                .contains(part)
                .then(|| Vector3::from(counts).map(|count| f32::from(count) / scale))
        };
        Motion {
            angular_velocity: vector(
                self.angular_velocity,
                Validity::ANGULAR_VELOCITY,
                ANGULAR_VELOCITY_COUNTS,
            )
            .map(Vector::from_components),
            velocity: vector(self.velocity, Validity::VELOCITY, SPEED_COUNTS)
                .map(Vector::from_components),
            horizontal_speed: self
                .valid
                .contains(Validity::HORIZONTAL_SPEED)
                .then(|| f32::from(self.horizontal_speed) / SPEED_COUNTS),
        }
    }
}

fn is_unit(rotation: &UnitQuaternion<f32>) -> bool {
    let size = rotation.coords.norm_squared();
    (size - 1.0).abs() < 2e-3
}

/// Counts of all three components; `None` if one is not finite or out of scale.
pub(super) fn counts_of(vector: Option<Vector3<f32>>, scale: f32) -> Option<[i16; 3]> {
    let [x, y, z]: [f32; 3] = vector?.into();
    // NaN would become 0 in the cast, so it is rejected here.
    let count = |value: f32| {
        value
            .is_finite()
            .then(|| i16::try_from(whole(value * scale)).ok())
            .flatten()
    };
    Some([count(x)?, count(y)?, count(z)?])
}

#[cfg(test)]
mod tests {
    use super::super::packed_quaternion::tests::rotation_error;
    use super::*;
    use nalgebra::Quaternion;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn motion_survives_within_half_a_count(
            w in prop::array::uniform3(-31.9f32..31.9),
            v in prop::array::uniform3(-127.9f32..127.9),
            speed in 0.0f32..255.9,
        ) {
            let motion = Motion {
                angular_velocity: Some(Vector::from_components(w.into())),
                velocity: Some(Vector::from_components(v.into())),
                horizontal_speed: Some(speed),
            };
            let read = Sample::new(&Posture::h_pose(), &Rotation::identity(), &motion).motion();
            let off = |a: Vector3<f32>, b: [f32; 3]| (a - Vector3::from(b)).abs().max();
            prop_assert!(off(read.angular_velocity.unwrap().components, w) <= 0.5001 / 1024.0);
            prop_assert!(off(read.velocity.unwrap().components, v) <= 0.5001 / 256.0);
            prop_assert!((read.horizontal_speed.unwrap() - speed).abs() <= 0.5001 / 256.0);
        }
    }

    #[test]
    fn a_posture_survives_packing_joint_by_joint() {
        let posture = Posture::h_pose()
            .with_angles(Segment::LeftHand, 0.3, -0.2, 1.1)
            .with_angles(Segment::Head, -0.1, 0.4, 0.0);
        let attitude = Rotation::from_wxyz([0.1, -0.7, 0.2, 0.6]).unwrap();
        let sample = Sample::new(&posture, &attitude, &Motion::default());
        assert_eq!(sample.valid, Validity::POSTURE | Validity::ATTITUDE);
        let read = sample.posture();
        for segment in Segment::ALL {
            let (sent, got) = (
                posture.parent_from_segment(segment),
                read.parent_from_segment(segment),
            );
            assert!(rotation_error(sent, got) < 1.505e-4, "{segment:?}");
        }
        let got = sample.inertial_from_body();
        assert!(rotation_error(attitude.quaternion(), got.quaternion()) < 1.505e-4);
        assert_eq!(sample.motion(), Motion::default());
    }

    #[test]
    fn unknown_values_are_absent() {
        let broken = UnitQuaternion::new_unchecked(Quaternion::new(f32::NAN, 0.0, 0.0, 1.0));
        for value in [f32::NAN, f32::INFINITY, -400.0, 1.0e30] {
            let motion = Motion {
                angular_velocity: Some(Vector::new(0.0, value, 0.0)),
                velocity: Some(Vector::new(0.0, 0.0, value)),
                horizontal_speed: Some(value),
            };
            let sample = Sample::new(
                &Posture::h_pose().with(Segment::Head, broken),
                &Rotation::from_quaternion(broken),
                &motion,
            );
            assert_eq!(sample.valid.bits(), 0, "{value}");
            assert_eq!(sample.posture(), Posture::h_pose());
            assert_eq!(sample.motion(), Motion::default());
        }
    }
}
