//! Whether the segments meet at their joints: the best check of a recording, and the way to determine its arm frame.
//!
//! Versions of MVN write the orientation of upper arms, forearms and hands in one of two frames: with the axes of the
//! T-pose, or with those of the International Society of Biomechanics (ISB). No flag says which. Both are tried on the
//! file; in the wrong one, elbows and wrists come apart by 0.3 m.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::header::{Header, SegmentDefinition};

/// Distance from a segment's origin within which a joint is there (m).
const ORIGIN: f64 = 0.003;

/// Frame in which a file gives the orientation of the arms.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArmFrame {
    /// All orientations are the identity in the T-pose, as in everything this module hands out.
    TPose,
    /// The arms have ISB axes.
    Isb,
}

impl ArmFrame {
    /// Name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::TPose => "t-pose",
            Self::Isb => "isb",
        }
    }
}

/// ISB axes of a segment in the axes of the T-pose; the identity except for the arms.
///
/// A file with ISB arms has these orientations in the T-pose.
pub fn t_pose_from_isb(label: &str) -> UnitQuaternion<f64> {
    const HALF: f64 = core::f64::consts::FRAC_1_SQRT_2;
    let [w, x, y, z] = match label {
        "RightUpperArm" => [HALF, -HALF, 0.0, 0.0],
        "LeftUpperArm" => [HALF, HALF, 0.0, 0.0],
        "RightForeArm" | "RightHand" => [0.5, -0.5, 0.5, 0.5],
        "LeftForeArm" | "LeftHand" => [0.5, 0.5, 0.5, -0.5],
        _ => [1.0, 0.0, 0.0, 0.0],
    };
    UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z))
}

/// The skeleton as pairs of points that should coincide.
#[derive(Debug, Clone, PartialEq)]
pub struct Skeleton {
    joints: Vec<[Connector; 2]>,
    /// For each segment, converts components along T-pose axes to components along ISB axes.
    isb_from_t_pose: Vec<UnitQuaternion<f64>>,
}

/// A point of a segment, given by the segment's index in a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Connector {
    segment: usize,
    point: Vector3<f64>,
}

/// The distance between the two points of a joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Index of the inner segment.
    pub segment: usize,
    /// Where the joint is on it, in its axes (m).
    pub lever: Vector3<f64>,
    /// From there to the point of the outer segment, in the axes of the inner one (m).
    pub gap: Vector3<f64>,
}

impl Skeleton {
    /// Creates the skeleton from the joints of a header or, if it lists none, from points with the same name on two
    /// segments.
    ///
    /// `None` if the file has no points to compare.
    pub fn of(header: &Header) -> Option<Self> {
        let connector = |text: &str| {
            let (label, point) = text.trim().split_once('/')?;
            let segment = header.segment_index(label)?;
            let point = *header.segments[segment].point(point)?;
            Some(Connector { segment, point })
        };
        let mut joints: Vec<_> = header
            .joints
            .iter()
            .filter_map(|joint| {
                let [parent, child] = &joint.connectors;
                Some([connector(parent)?, connector(child)?])
            })
            .collect();
        if joints.is_empty() {
            joints = shared_points(&header.segments);
        }
        (!joints.is_empty()).then(|| Self {
            joints,
            ..Self::without_joints(header)
        })
    }

    /// Creates the skeleton of a file without points, in which no joint can be compared.
    pub fn without_joints(header: &Header) -> Self {
        let labels = header.segments.iter().map(|segment| &segment.label);
        Self {
            joints: Vec::new(),
            isb_from_t_pose: labels
                .map(|label| t_pose_from_isb(label).inverse())
                .collect(),
        }
    }

    /// Largest distance (m) between the two points of a joint. Orientations (w x y z) and positions are as in the file,
    /// which is taken to be in `arm_frame`. Infinite if there are too few numbers.
    pub fn closure_error(&self, orientation: &[f64], position: &[f64], arm_frame: ArmFrame) -> f64 {
        let worst = self.worst_joint(orientation, position, arm_frame);
        worst.map_or(0.0, |(_, apart)| apart)
    }

    /// The joint whose two points are furthest apart, as the index of its outer segment, and that distance (m); `None`
    /// if there are no joints. Arguments as for [`Skeleton::closure_error`].
    pub fn worst_joint(
        &self,
        orientation: &[f64],
        position: &[f64],
        arm_frame: ArmFrame,
    ) -> Option<(usize, f64)> {
        let place = |connector: &Connector| {
            let at = connector.segment;
            let (origin, attitude) = placed(orientation, position, at)?;
            let attitude = match arm_frame {
                ArmFrame::TPose => attitude,
                ArmFrame::Isb => attitude * self.isb_from_t_pose[at],
            };
            Some(origin + attitude * connector.point)
        };
        self.joints
            .iter()
            .map(|[a, b]| match (place(a), place(b)) {
                (Some(near), Some(far)) => (b.segment, (near - far).norm()),
                _ => (b.segment, f64::INFINITY),
            })
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The distances at all joints whose outer segment begins there, always in the same order. Orientations (w x y z) are
    /// those of the T-pose.
    pub fn gaps<'a>(
        &'a self,
        orientation: &'a [f64],
        position: &'a [f64],
    ) -> impl Iterator<Item = Gap> + 'a {
        let place = |at| placed(orientation, position, at);
        let begins = |[_, outer]: &&[Connector; 2]| outer.point.norm() < ORIGIN;
        self.joints.iter().filter(begins).filter_map(move |[a, b]| {
            let ((from, attitude), (to, _)) = (place(a.segment)?, place(b.segment)?);
            Some(Gap {
                segment: a.segment,
                lever: a.point,
                gap: attitude.inverse() * (to - from) - a.point,
            })
        })
    }

    /// Converts orientations w x y z from ISB to T-pose arm axes.
    pub fn convert_to_t_pose(&self, orientation: &mut [f64]) {
        for (q, isb_from_t_pose) in orientation.chunks_exact_mut(4).zip(&self.isb_from_t_pose) {
            let converted = Quaternion::new(q[0], q[1], q[2], q[3]) * isb_from_t_pose.quaternion();
            q.copy_from_slice(&[converted.w, converted.i, converted.j, converted.k]);
        }
    }
}

/// Origin (m) and attitude of a segment among the numbers of a frame; `None` if there are too few.
fn placed(
    orientation: &[f64],
    position: &[f64],
    segment: usize,
) -> Option<(Vector3<f64>, UnitQuaternion<f64>)> {
    let q = orientation.get(4 * segment..4 * segment + 4)?;
    let p = position.get(3 * segment..3 * segment + 3)?;
    let attitude = UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]));
    Some((Vector3::from_column_slice(p), attitude))
}

/// Joints found by points with the same name; landmarks (`p...`) may be on two segments without being joints.
fn shared_points(segments: &[SegmentDefinition]) -> Vec<[Connector; 2]> {
    let mut joints = Vec::new();
    for (child, segment) in segments.iter().enumerate() {
        for point in segment
            .points
            .iter()
            .filter(|point| point.label.starts_with('j'))
        {
            let parent = segments[..child]
                .iter()
                .enumerate()
                .find_map(|(at, parent)| Some((at, *parent.point(&point.label)?)));
            if let Some((at, parent)) = parent {
                joints.push([
                    Connector {
                        segment: at,
                        point: parent,
                    },
                    Connector {
                        segment: child,
                        point: point.position,
                    },
                ]);
            }
        }
    }
    joints
}
