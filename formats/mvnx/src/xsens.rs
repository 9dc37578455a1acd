//! From the 23 segments of Xsens MVN to the 16 of the model, and back.
//!
//! The global frame of MVN (X magnetic north, Y west, Z up) is the inertial frame: positions and velocities are used as
//! they are. Only the axes of the segments differ. MVN gives the orientation of each segment relative to the T-pose, in
//! its own axes (X forward, Y left, Z up); the model gives each joint relative to the H-pose, in the axes of the body
//! frame. Three constant rotations relate them, see [`xsens_from_segment`]: the change of axes, the lowering of the
//! arms from the T-pose to the H-pose, and the turn of the hands from palm inwards to palm forwards. See the paper's
//! section "Interpreting Xsens measurements" and model.md "Frames and rotations"; the paper's eqs. (qXsens2SM) to
//! (qXsens2SM4) are these rotations for one joint.

pub mod skeleton;
pub mod y_up;

use core::f64::consts::FRAC_1_SQRT_2;

use bodyflight_core::frame::{Body, Inertial, Rotation, SegmentFrame, XsensSegment};
use bodyflight_core::{Posture, Segment, SegmentArray};
use nalgebra::{Quaternion, UnitQuaternion};

/// Number of segments in MVN.
pub const MVN_SEGMENT_COUNT: usize = 23;

/// A row of the table of MVN segments.
struct Row {
    label: &'static str,
    parent: Option<MvnSegment>,
    /// Joint that connects to the parent.
    joint: &'static str,
    /// The segment of the model that it is a part of.
    part_of: Segment,
    /// Whether the model's segment takes its orientation; the other parts move with it.
    leads: bool,
}

macro_rules! mvn_segments {
    ($($label:ident $parent:expr, $joint:literal, $part_of:ident $leads:literal;)*) => {
        /// A segment of MVN, in the order of its files.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[expect(missing_docs, reason = "the names are those of MVN")]
        pub enum MvnSegment {
            $($label,)*
        }

        impl MvnSegment {
            /// All segments, parents before children.
            pub const ALL: [Self; MVN_SEGMENT_COUNT] = [$(Self::$label),*];

            const fn row(self) -> Row {
                use MvnSegment::*;
                match self {
                    $(Self::$label => Row {
                        label: stringify!($label),
                        parent: $parent,
                        joint: $joint,
                        part_of: Segment::$part_of,
                        leads: $leads,
                    },)*
                }
            }
        }
    };
}

mvn_segments! {
    Pelvis None, "", Pelvis true;
    L5 Some(Pelvis), "jL5S1", Abdomen false;
    L3 Some(L5), "jL4L3", Abdomen true;
    T12 Some(L3), "jL1T12", Thorax false;
    T8 Some(T12), "jT9T8", Thorax true;
    Neck Some(T8), "jT1C7", Head false;
    Head Some(Neck), "jC1Head", Head true;
    RightShoulder Some(T8), "jRightT4Shoulder", Thorax false;
    RightUpperArm Some(RightShoulder), "jRightShoulder", RightUpperArm true;
    RightForeArm Some(RightUpperArm), "jRightElbow", RightForearm true;
    RightHand Some(RightForeArm), "jRightWrist", RightHand true;
    LeftShoulder Some(T8), "jLeftT4Shoulder", Thorax false;
    LeftUpperArm Some(LeftShoulder), "jLeftShoulder", LeftUpperArm true;
    LeftForeArm Some(LeftUpperArm), "jLeftElbow", LeftForearm true;
    LeftHand Some(LeftForeArm), "jLeftWrist", LeftHand true;
    RightUpperLeg Some(Pelvis), "jRightHip", RightThigh true;
    RightLowerLeg Some(RightUpperLeg), "jRightKnee", RightShank true;
    RightFoot Some(RightLowerLeg), "jRightAnkle", RightFoot true;
    RightToe Some(RightFoot), "jRightBallFoot", RightFoot false;
    LeftUpperLeg Some(Pelvis), "jLeftHip", LeftThigh true;
    LeftLowerLeg Some(LeftUpperLeg), "jLeftKnee", LeftShank true;
    LeftFoot Some(LeftLowerLeg), "jLeftAnkle", LeftFoot true;
    LeftToe Some(LeftFoot), "jLeftBallFoot", LeftFoot false;
}

impl MvnSegment {
    /// Name in files.
    pub const fn label(self) -> &'static str {
        self.row().label
    }

    /// The segment at the proximal joint, `None` for the pelvis.
    pub const fn parent(self) -> Option<Self> {
        self.row().parent
    }

    /// Name of the proximal joint in version 4, empty for the pelvis.
    pub const fn joint(self) -> &'static str {
        self.row().joint
    }

    /// The segment of the model that this one is a part of.
    pub const fn part_of(self) -> Segment {
        self.row().part_of
    }

    /// The MVN segment whose orientation a segment of the model takes: L3 for the abdomen, T8 for the
    /// thorax, the one of the same name for all others.
    pub fn leading(segment: Segment) -> Self {
        Self::ALL
            .into_iter()
            .find(|mvn| mvn.part_of() == segment && mvn.row().leads)
            .unwrap_or(Self::Pelvis)
    }
}

/// Model axes to Xsens axes: x_xsens = -y, y_xsens = x, paper eq. (qXsens2SM1).
fn xsens_axes_from_model_axes() -> UnitQuaternion<f64> {
    UnitQuaternion::new_unchecked(Quaternion::new(FRAC_1_SQRT_2, 0.0, 0.0, FRAC_1_SQRT_2))
}

/// Rotation from the axes that the model gives a segment (those of the body in the H-pose) to the axes that MVN gives
/// it (those of the global frame in the T-pose).
///
/// Arms: about X by -90 deg for the right and +90 deg for the left, which raises the hanging arm to the side, paper eq.
/// (qXsens2SM2). Hands: in addition about the long axis, which turns the palm from inwards to forwards in the H-pose,
/// paper eq. (qXsens2SM3). Feet point forward in both poses.
pub fn xsens_from_segment(segment: Segment) -> Rotation<f64, XsensSegment, SegmentFrame> {
    let raise_right = Quaternion::new(FRAC_1_SQRT_2, -FRAC_1_SQRT_2, 0.0, 0.0);
    let raise_left = raise_right.conjugate();
    let palm_forward = Quaternion::new(FRAC_1_SQRT_2, 0.0, FRAC_1_SQRT_2, 0.0);
    let t_pose_from_h_pose = match segment {
        Segment::RightUpperArm | Segment::RightForearm => raise_right,
        Segment::LeftUpperArm | Segment::LeftForearm => raise_left,
        Segment::RightHand => palm_forward * raise_right,
        Segment::LeftHand => palm_forward * raise_left,
        _ => Quaternion::identity(),
    };
    Rotation::from_quaternion(
        UnitQuaternion::new_unchecked(t_pose_from_h_pose) * xsens_axes_from_model_axes(),
    )
}

/// Returns the attitude of the body and the posture, from the orientations that MVN gives the leading segments.
pub fn attitude_and_posture(
    xsens_from_mvn_segment: &SegmentArray<UnitQuaternion<f64>>,
) -> (Rotation<f64, Inertial, Body>, Posture<f64>) {
    let inertial_from_segment = xsens_from_mvn_segment.map(|segment, orientation| {
        let orientation = Rotation::<f64, Inertial, XsensSegment>::from_quaternion(*orientation);
        *(orientation * xsens_from_segment(segment)).quaternion()
    });
    // Joints are relative, so rotations in any common frame give the posture.
    let posture = Posture::from_body_rotations(&inertial_from_segment);
    let inertial_from_body = inertial_from_segment[Segment::Pelvis];
    (Rotation::from_quaternion(inertial_from_body), posture)
}

/// Returns the orientation that MVN would give each of the model's segments: the inverse of [`attitude_and_posture`].
pub fn mvn_orientations(
    inertial_from_body: Rotation<f64, Inertial, Body>,
    posture: &Posture<f64>,
) -> SegmentArray<Rotation<f64, Inertial, XsensSegment>> {
    posture.body_from_segments().map(|segment, rotation| {
        let body_from_segment = Rotation::<f64, Body, SegmentFrame>::from_quaternion(*rotation);
        inertial_from_body * body_from_segment * xsens_from_segment(segment).inverse()
    })
}

/// The posture in which every orientation of MVN is the identity: standing, arms out to the sides, palms down.
pub fn t_pose() -> Posture<f64> {
    attitude_and_posture(&SegmentArray::from_fn(|_| UnitQuaternion::identity())).1
}

/// The attitude in which MVN's orientation of the pelvis is the identity: upright, facing north, along the X axis of
/// the global frame.
pub fn facing_forward() -> Rotation<f64, Inertial, Body> {
    attitude_and_posture(&SegmentArray::from_fn(|_| UnitQuaternion::identity())).0
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::frame::{Vector, facing_north};
    use nalgebra::Vector3;
    use proptest::prelude::*;

    fn close(a: Vector3<f64>, b: Vector3<f64>) -> bool {
        (a - b).norm() < 1e-12
    }

    #[test]
    fn the_t_pose_has_arms_out_and_palms_down() {
        let (attitude, posture) =
            attitude_and_posture(&SegmentArray::from_fn(|_| UnitQuaternion::identity()));
        let body_from = posture.body_from_segments();
        let distal = -Vector3::z();
        for (segment, side) in [
            (Segment::LeftUpperArm, 1.0),
            (Segment::LeftForearm, 1.0),
            (Segment::LeftHand, 1.0),
            (Segment::RightUpperArm, -1.0),
            (Segment::RightForearm, -1.0),
            (Segment::RightHand, -1.0),
        ] {
            // X is left, so the left arm points along +X.
            assert!(
                close(body_from[segment] * distal, Vector3::x() * side),
                "{segment:?}"
            );
        }
        for hand in [Segment::LeftHand, Segment::RightHand] {
            // The palm is on the ventral side (-Y) of the hand's frame.
            assert!(
                close(body_from[hand] * -Vector3::y(), -Vector3::z()),
                "{hand:?}"
            );
        }
        for segment in [
            Segment::Abdomen,
            Segment::Head,
            Segment::LeftThigh,
            Segment::RightFoot,
        ] {
            assert!(posture.parent_from_segment(segment).angle() < 1e-12);
        }
        // Facing north: forward (-Y of the body) is the global X axis.
        let forward = attitude * Vector::new(0.0, -1.0, 0.0);
        assert!(close(forward.components, Vector3::x()));
        assert!(
            facing_north(0.0)
                .quaternion()
                .angle_to(attitude.quaternion())
                < 1e-12
        );
    }

    #[test]
    fn hanging_arms_are_the_h_pose() {
        let orientations = mvn_orientations(facing_forward(), &Posture::h_pose());
        let right_arm = orientations[Segment::RightUpperArm];
        // From the T-pose to hanging, the right arm turns by +90 deg about the forward axis.
        let hanging = UnitQuaternion::from_euler_angles(core::f64::consts::FRAC_PI_2, 0.0, 0.0);
        assert!(hanging.angle_to(right_arm.quaternion()) < 1e-7);
    }

    #[test]
    fn the_paper_s_wrist_quaternion() {
        // Paper eq. (qXsens2SM3) is [.5, .5, .5, -.5]: for the left hand, in Xsens axes on both sides.
        let left = xsens_from_segment(Segment::LeftHand).quaternion()
            * xsens_axes_from_model_axes().inverse();
        let printed = Quaternion::new(0.5, 0.5, 0.5, -0.5);
        assert!((left.quaternion() - printed).norm() < 1e-12);
    }

    #[test]
    fn every_segment_has_one_leader() {
        for segment in Segment::ALL {
            let leaders = MvnSegment::ALL
                .into_iter()
                .filter(|mvn| mvn.row().leads && mvn.part_of() == segment);
            assert_eq!(leaders.count(), 1, "{segment:?}");
            assert_eq!(MvnSegment::leading(segment).part_of(), segment);
        }
        for mvn in MvnSegment::ALL {
            if let Some(parent) = mvn.parent() {
                assert!((parent as usize) < mvn as usize);
            }
        }
    }

    pub(crate) fn any_rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
        prop::array::uniform4(-1.0f64..1.0)
            .prop_filter("needs a direction", |q| {
                q.iter().map(|c| c * c).sum::<f64>() > 0.01
            })
            .prop_map(|q| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3])))
    }

    proptest! {
        #[test]
        fn postures_survive_conversion_to_mvn(
            attitude in any_rotation(),
            joints in prop::collection::vec(any_rotation(), 16),
        ) {
            let attitude = Rotation::from_quaternion(attitude);
            let posture = Segment::ALL.into_iter().zip(joints)
                .fold(Posture::h_pose(), |posture, (segment, joint)| posture.with(segment, joint));
            let mvn = mvn_orientations(attitude, &posture).map(|_, rotation| *rotation.quaternion());
            let (attitude_again, posture_again) = attitude_and_posture(&mvn);
            let difference = |a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>| {
                a.rotation_to(b).imag().norm()
            };
            prop_assert!(difference(attitude.quaternion(), attitude_again.quaternion()) < 1e-12);
            for segment in Segment::ALL {
                prop_assert!(difference(
                    posture.parent_from_segment(segment),
                    posture_again.parent_from_segment(segment),
                ) < 1e-12, "{:?}", segment);
            }
        }
    }
}
