//! Parts of the body that contradict the rest: a segment that keeps its attitude while all others turn, and joints
//! whose two sides are apart. Each finding names the segment and the time.

use bodyflight_core::SegmentArray;
use nalgebra::{UnitQuaternion, Vector3};

use super::frame::FlightFrame;
use super::warning::Warning;

/// Shortest time that a segment keeps its attitude to be called frozen (s).
const FROZEN_FOR: f64 = 0.2;
/// Change of a component of a quaternion below which an attitude is the same, as in a repeated number.
pub(super) const SAME: f64 = 1e-9;
/// Fewest other segments that must turn meanwhile: a body at rest is not frozen.
const TURNING: usize = 12;
/// The same for the angle of a joint, whose two segments are rounded (component of a quaternion), the fewest other joints
/// that must move meanwhile, and the shortest time (s).
const SAME_JOINT: f64 = 4e-6;
const MOVING: usize = 8;
const STIFF_FOR: f64 = 0.5;
/// Distance from either end of the joint's range (rad), where a solver may hold it.
const WITHIN: f64 = 1e-3;
/// Shortest recording without any rotation that is no recording of attitudes (s).
const RIGID_FOR: f64 = 2.0;
/// Path that tells such a recording from one of a body at rest (m).
const RIGID_PATH: f64 = 10.0;
/// Largest distance between the two sides of a joint (m).
pub(super) const JOINT_LIMIT: f64 = 0.05;

/// A run of frames.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Run {
    first: (u64, f64),
    last: f64,
    /// Largest value in it; of a body that never turns, the path (m).
    largest: f64,
}

impl Run {
    fn new(frame: &FlightFrame) -> Self {
        Self {
            first: (frame.index, frame.time),
            last: frame.time,
            largest: 0.0,
        }
    }

    fn length(&self) -> f64 {
        self.last - self.first.1
    }
}

/// The joint that closes worst in a frame, by the name of its outer segment.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct OpenJoint {
    pub(super) segment: String,
    /// Distance between its two sides (m).
    pub(super) apart: f64,
}

/// Cosine of the tilt of a pelvis that is exactly upright.
const UPRIGHT: f64 = 1.0 - 1e-9;

/// A joint that may have stopped.
#[derive(Debug, Clone, Copy)]
struct Joint {
    /// Its rotation when it stopped.
    kept: UnitQuaternion<f64>,
    still: Option<Run>,
    longest: Option<Run>,
    /// Angle (rad) kept for the longest time, and the smallest and largest of all.
    angle: f64,
    range: [f64; 2],
}

/// Attitudes of the segments.
pub(super) type Attitudes = SegmentArray<UnitQuaternion<f64>>;

/// The largest change of a component of each segment's quaternion, whose sign means nothing.
pub(super) fn changes(before: &Attitudes, here: &Attitudes) -> SegmentArray<f64> {
    here.map(|segment, turned| {
        let before = before[segment].coords;
        (turned.coords - before)
            .amax()
            .min((turned.coords + before).amax())
    })
}

/// What has been seen of single segments.
#[derive(Debug, Clone, Default)]
pub(super) struct Plausibility {
    still: Option<SegmentArray<Option<Run>>>,
    frozen: Option<SegmentArray<Option<Run>>>,
    joints: Option<SegmentArray<Joint>>,
    open: Vec<(String, Run)>,
    /// The time in which no segment turns at all, if none ever did.
    rigid: Option<Run>,
    /// Whether the pelvis is upright then, as it is where attitudes are left at one.
    stands: bool,
    has_turned: bool,
}

impl Plausibility {
    /// Takes a good frame, with the one before and the [changes] of attitudes since, and its joint that closes worst.
    pub(super) fn see(
        &mut self,
        frame: &FlightFrame,
        before: Option<(&FlightFrame, &SegmentArray<f64>)>,
        joint: Option<OpenJoint>,
    ) {
        if let Some(joint) = joint.filter(|joint| joint.apart > JOINT_LIMIT) {
            let known = self
                .open
                .iter()
                .position(|(segment, _)| *segment == joint.segment);
            let at = known.unwrap_or_else(|| {
                self.open.push((joint.segment, Run::new(frame)));
                self.open.len() - 1
            });
            let run = &mut self.open[at].1;
            run.last = frame.time;
            run.largest = run.largest.max(joint.apart);
        }
        if let Some((before, changes)) = before {
            self.compare(before, frame, changes);
            self.has_turned |= changes.values().any(|change| *change >= SAME);
            let up = *before.pelvis.inertial_from_body.quaternion() * Vector3::z();
            self.stands = up.z > UPRIGHT;
            let rigid = self.rigid.get_or_insert_with(|| Run::new(before));
            rigid.last = frame.time;
            let moved = frame.pelvis.position.components - before.pelvis.position.components;
            rigid.largest += moved.norm();
            self.move_joints(before, frame);
        }
    }

    fn move_joints(&mut self, before: &FlightFrame, frame: &FlightFrame) {
        let of = |frame: &FlightFrame| {
            SegmentArray::from_fn(|segment| *frame.posture.parent_from_segment(segment))
        };
        let (last, here) = (of(before), of(frame));
        let moved = changes(&last, &here);
        let moving = moved
            .values()
            .filter(|change| **change > SAME_JOINT)
            .count();
        let joints = self.joints.get_or_insert_with(|| {
            last.map(|_, kept| Joint {
                kept: *kept,
                still: None,
                longest: None,
                angle: 0.0,
                range: [f64::INFINITY, f64::NEG_INFINITY],
            })
        });
        for (segment, joint) in joints.iter_mut() {
            let (turned, angle) = (here[segment].coords, here[segment].angle());
            joint.range = [joint.range[0].min(angle), joint.range[1].max(angle)];
            let kept = joint.kept.coords;
            let change = (turned - kept).amax().min((turned + kept).amax());
            if change > SAME_JOINT || moving < MOVING {
                joint.kept = here[segment];
                joint.still = None;
                continue;
            }
            let run = joint.still.get_or_insert_with(|| Run::new(before));
            run.last = frame.time;
            if joint
                .longest
                .is_none_or(|longest| run.length() > longest.length())
            {
                joint.longest = Some(*run);
                joint.angle = angle;
            }
        }
    }

    /// Joints that stop within their range while others move.
    fn stiff(&self) -> Vec<Warning> {
        let joints = self.joints.iter().flat_map(SegmentArray::iter);
        let stiff = joints.filter_map(|(segment, joint)| {
            let run = joint.longest.filter(|run| run.length() >= STIFF_FOR)?;
            let [low, high] = joint.range;
            let is_within = (low + WITHIN..high - WITHIN).contains(&joint.angle);
            let is_frozen = (self.frozen.as_ref())
                .and_then(|frozen| frozen[segment])
                .is_some_and(|frozen| frozen.length() >= FROZEN_FOR);
            (is_within && !is_frozen).then(|| {
                let name = segment.name();
                let message = format!(
                    "the joint of {name} keeps exactly the same angle from {:.3} to {:.3} s while others move: its angles are frozen",
                    run.first.1, run.last
                );
                fault(name, &run, message)
            })
        });
        stiff.collect()
    }

    fn compare(&mut self, before: &FlightFrame, frame: &FlightFrame, changes: &SegmentArray<f64>) {
        let same = changes.map(|_, change| *change < SAME);
        let turning = same.values().filter(|same| !**same).count();
        let still = self
            .still
            .get_or_insert_with(|| SegmentArray::from_fn(|_| None));
        let frozen = self
            .frozen
            .get_or_insert_with(|| SegmentArray::from_fn(|_| None));
        for (segment, same) in same.iter() {
            if !same || turning < TURNING {
                still[segment] = None;
                continue;
            }
            let run = still[segment].get_or_insert_with(|| Run::new(before));
            run.last = frame.time;
            let longest = &mut frozen[segment];
            if longest.is_none_or(|longest| run.length() > longest.length()) {
                *longest = Some(*run);
            }
        }
    }

    /// What is implausible so far.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let frozen = self.frozen.iter().flat_map(SegmentArray::iter);
        let frozen = frozen.filter_map(|(segment, run)| {
            let run = run.filter(|run| run.length() >= FROZEN_FOR)?;
            let name = segment.name().to_owned();
            let message = format!(
                "{name} keeps exactly the same attitude from {:.3} to {:.3} s while the body turns: its sensor is frozen",
                run.first.1, run.last
            );
            Some(fault(&name, &run, message))
        });
        let open = self.open.iter().map(|(segment, run)| {
            let message = format!(
                "the joint at {segment} is up to {:.2} m apart from {:.3} to {:.3} s; expected below {JOINT_LIMIT} m",
                run.largest, run.first.1, run.last
            );
            fault(segment, run, message)
        });
        let rigid = self.rigid.filter(|run| {
            !self.has_turned && run.length() >= RIGID_FOR && run.largest > RIGID_PATH
        });
        let rigid = rigid.map(|run| {
            let message = format!(
                "no segment turns at all from {:.3} to {:.3} s: the attitudes are not recorded",
                run.first.1, run.last
            );
            // A steady fall may have been made up.
            Warning {
                is_fault: self.stands,
                ..Warning::fault(run.first.0, [run.first.1, run.last], message)
            }
        });
        frozen
            .chain(self.stiff())
            .chain(open)
            .chain(rigid)
            .collect()
    }
}

fn fault(segment: &str, run: &Run, message: String) -> Warning {
    Warning {
        segment: Some(segment.to_owned()),
        ..Warning::fault(run.first.0, [run.first.1, run.last], message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::PelvisMotion;
    use bodyflight_core::frame::{Rotation, Vector};
    use bodyflight_core::{Posture, Segment};

    /// A body that tumbles with both arms moving, and one segment that keeps its attitude from a frame on.
    fn watched(frozen: Option<(Segment, u64)>, rate: f64) -> Vec<Warning> {
        let mut seen = Plausibility::default();
        let mut kept = None;
        let mut last: Option<(FlightFrame, Attitudes)> = None;
        for index in 0..400_u64 {
            let time = index as f64 / rate;
            let attitude =
                UnitQuaternion::from_euler_angles(1.3 * time, 0.4 * time.sin(), 0.7 * time);
            let posture = Posture::h_pose()
                .with_angles(Segment::LeftUpperArm, 0.0, time.sin(), 0.2)
                .with_angles(Segment::RightUpperArm, 0.0, time.cos(), 0.1);
            let mut turned = posture
                .body_from_segments()
                .map(|_, turned| attitude * turned);
            if let Some((segment, _)) = frozen.filter(|(_, from)| index >= *from) {
                turned[segment] = *kept.get_or_insert(turned[segment]);
            }
            let frame = FlightFrame {
                index,
                time,
                posture: Posture::from_body_rotations(&turned),
                pelvis: PelvisMotion {
                    inertial_from_body: Rotation::from_quaternion(attitude),
                    position: Vector::zero(),
                    velocity: None,
                    angular_velocity: None,
                },
                centre_of_mass: None,
                bridged: false,
            };
            let apart = if index == 50 { 0.2 } else { 0.001 };
            let joint = OpenJoint {
                segment: "LeftHand".to_owned(),
                apart,
            };
            let before = last.replace((frame, turned));
            let changes = before.as_ref().map(|(_, before)| changes(before, &turned));
            let before = before
                .as_ref()
                .map(|(frame, _)| frame)
                .zip(changes.as_ref());
            seen.see(&frame, before, Some(joint));
        }
        seen.warnings()
    }

    #[test]
    fn a_frozen_segment_and_an_open_joint_are_named_with_their_time() {
        for segment in [Segment::RightForearm, Segment::LeftFoot, Segment::Thorax] {
            let said = watched(Some((segment, 150)), 100.0);
            assert_eq!(said.len(), 2, "{said:?}");
            assert_eq!(said[0].segment.as_deref(), Some(segment.name()));
            assert_eq!((said[0].frame, said[0].span_s), (150, Some([1.5, 3.99])));
            assert_eq!(
                (said[1].segment.as_deref(), said[1].frame),
                (Some("LeftHand"), 50)
            );
        }
        assert_eq!(watched(None, 100.0).len(), 1);
    }
}
