//! The skeleton of MVN placed over a body of the model: where its 23 segments and 22 joints are.
//!
//! MVN has more joints in the trunk than the model. The extra ones are placed at fixed fractions of the model's
//! segments: they are rigid there, so they change the drawing but not the motion.

use bodyflight_core::body::posture::pose;
use bodyflight_core::{Body, Posture, Segment, SegmentArray};
use nalgebra::{UnitQuaternion, Vector3};

use super::{MVN_SEGMENT_COUNT, MvnSegment, mvn_orientations, xsens_from_segment};
use bodyflight_core::frame::{self, Inertial, Rotation, XsensSegment};

/// Positions of the extra MVN joints on their segments of the model, as fractions of the length: L3 on the abdomen, T8
/// on the thorax, the skull on head and neck.
const L3_SHARE: f64 = 0.5;
const T8_SHARE: f64 = 0.4;
const SKULL_SHARE: f64 = 0.35;
/// The sternoclavicular joint, as a fraction of the way from the mid-line to the shoulder.
const CLAVICLE_SHARE: f64 = 0.2;
/// The ball of the foot ahead of the foot's centre, as a fraction of its length.
const BALL_SHARE: f64 = 0.25;

/// MVN segments and points of one body.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Origin of each MVN segment in the H-pose, body axes (m).
    origins: [Vector3<f64>; MVN_SEGMENT_COUNT],
    /// Proximal joint of each of the model's segments in the H-pose, body axes (m).
    joints: SegmentArray<Vector3<f64>>,
    body: Body<f64>,
}

/// A named point on a segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Name in files.
    pub label: String,
    /// Position in the axes that MVN gives the segment, from its origin (m).
    pub position: Vector3<f64>,
}

/// Orientation and origin of an MVN segment in the global frame of MVN.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Global from segment.
    pub orientation: UnitQuaternion<f64>,
    /// Origin (m).
    pub position: Vector3<f64>,
}

impl Default for Placed {
    fn default() -> Self {
        Self {
            orientation: UnitQuaternion::identity(),
            position: Vector3::zeros(),
        }
    }
}

impl Layout {
    /// The skeleton of a body.
    pub fn new(body: &Body<f64>) -> Self {
        let posed = pose(body, &Posture::h_pose());
        let joints = posed.map(|_, segment| segment.joint);
        let along = |segment: Segment, share: f64| {
            joints[segment] + Vector3::z() * (body.segments[segment].length * share)
        };
        let clavicle = |upper_arm: Segment| {
            let shoulder = joints[upper_arm];
            Vector3::new(shoulder.x * CLAVICLE_SHARE, shoulder.y, shoulder.z)
        };
        let ball = |foot: Segment| {
            let ahead = body.segments[foot].length * BALL_SHARE;
            posed[foot].cg - Vector3::y() * ahead
        };
        let origins = MvnSegment::ALL.map(|mvn| match mvn {
            MvnSegment::L3 => along(Segment::Abdomen, L3_SHARE),
            MvnSegment::T8 => along(Segment::Thorax, T8_SHARE),
            MvnSegment::Head => along(Segment::Head, SKULL_SHARE),
            MvnSegment::RightShoulder => clavicle(Segment::RightUpperArm),
            MvnSegment::LeftShoulder => clavicle(Segment::LeftUpperArm),
            MvnSegment::RightToe => ball(Segment::RightFoot),
            MvnSegment::LeftToe => ball(Segment::LeftFoot),
            _ => joints[mvn.part_of()],
        });
        Self {
            origins,
            joints,
            body: *body,
        }
    }

    /// Points of a segment: its origin, the joints of its children, and its end.
    pub fn points(&self, mvn: MvnSegment) -> Vec<Point> {
        let origin = self.origins[mvn as usize];
        let axes = xsens_from_segment(mvn.part_of());
        let point = |label: &str, at: Vector3<f64>| Point {
            label: label.to_owned(),
            position: axes.quaternion() * (at - origin),
        };
        let own = match mvn.joint() {
            "" => "pHipOrigin",
            joint => joint,
        };
        let children = MvnSegment::ALL
            .into_iter()
            .filter(|child| child.parent() == Some(mvn))
            .map(|child| point(child.joint(), self.origins[child as usize]));
        core::iter::once(point(own, origin))
            .chain(children)
            .chain(self.end(mvn).map(|(label, at)| point(label, at)))
            .collect()
    }

    /// The landmark at the free end of a segment, body axes in the H-pose (m).
    fn end(&self, mvn: MvnSegment) -> Option<(&'static str, Vector3<f64>)> {
        let segment = mvn.part_of();
        let parameters = &self.body.segments[segment];
        let along = |axis: Vector3<f64>| self.joints[segment] + axis * parameters.length;
        let of_foot = |share: f64| {
            self.joints[segment] + parameters.cg - Vector3::y() * (parameters.length * share)
        };
        Some(match mvn {
            MvnSegment::Head => ("pTopOfHead", along(Vector3::z())),
            MvnSegment::RightHand => ("pRightTopOfHand", along(-Vector3::z())),
            MvnSegment::LeftHand => ("pLeftTopOfHand", along(-Vector3::z())),
            MvnSegment::RightFoot => ("pRightHeelFoot", of_foot(-0.5)),
            MvnSegment::LeftFoot => ("pLeftHeelFoot", of_foot(-0.5)),
            MvnSegment::RightToe => ("pRightToe", of_foot(0.5)),
            MvnSegment::LeftToe => ("pLeftToe", of_foot(0.5)),
            _ => return None,
        })
    }

    /// Height of the pelvic joint above the soles when standing (m).
    pub fn standing_height(&self) -> f64 {
        let sole = |foot: Segment| {
            // The ankle is at the top of the foot, the centre half-way down.
            self.joints[foot].z + 2.0 * self.body.segments[foot].cg.z
        };
        -sole(Segment::LeftFoot).min(sole(Segment::RightFoot))
    }

    /// All MVN segments of the posed body; `position` is that of the pelvic joint.
    pub fn place(
        &self,
        inertial_from_body: Rotation<f64, Inertial, frame::Body>,
        position: frame::Vector<f64, Inertial>,
        posture: &Posture<f64>,
    ) -> [Placed; MVN_SEGMENT_COUNT] {
        let posed = pose(&self.body, posture);
        let orientations: SegmentArray<Rotation<f64, Inertial, XsensSegment>> =
            mvn_orientations(inertial_from_body, posture);
        MvnSegment::ALL.map(|mvn| {
            let segment = mvn.part_of();
            let orientation = orientations[segment];
            // In the H-pose all axes are parallel to the body's, so the difference is also in segment axes.
            let on_segment = self.origins[mvn as usize] - self.joints[segment];
            let in_body = posed[segment].joint + posed[segment].body_from_segment * on_segment;
            let inertial = position + inertial_from_body * frame::Vector::from_components(in_body);
            Placed {
                orientation: *orientation.quaternion(),
                position: inertial.components,
            }
        })
    }
}
