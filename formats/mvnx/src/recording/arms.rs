//! The convention of the arms, found from how well the segments meet.

use super::plausibility::JOINT_LIMIT;
use crate::closure::Skeleton;
use crate::{ArmFrame, Field, Frame, FrameKind, Header};
use bodyflight_io::diagnostic::Problem;

/// Largest closure error of a usable recording (m): well above the 0.01 of a good file whose shoulder girdle moves, and
/// well below the 0.2 or more that a wrong convention gives.
pub const CLOSURE_LIMIT: f64 = JOINT_LIMIT;

/// The convention of the arms with which the segments meet best, and the remaining closure error (m).
///
/// The calibration frame in ISB axes, which version 4 adds, is ignored: it says nothing about the others. Returns
/// `None` if no good frame has orientation and position.
pub fn arm_frame<'a>(
    skeleton: &Skeleton,
    calibration: &'a [Frame],
    normal: impl Iterator<Item = &'a Frame>,
) -> Option<(ArmFrame, f64)> {
    let calibration = calibration
        .iter()
        .filter(|frame| frame.kind != FrameKind::TposeIsb);
    let mut errors = [f64::NEG_INFINITY; 2];
    for frame in calibration
        .chain(normal)
        .filter(|frame| frame.fault.is_none())
    {
        let numbers = frame.numbers(Field::Orientation);
        if let (Some(orientation), Some(position)) = (numbers, frame.numbers(Field::Position)) {
            for (error, arms) in errors.iter_mut().zip([ArmFrame::TPose, ArmFrame::Isb]) {
                *error = error.max(skeleton.closure_error(orientation, position, arms));
            }
        }
    }
    let [t_pose, isb] = errors;
    (t_pose >= 0.0).then_some(if isb < t_pose {
        (ArmFrame::Isb, isb)
    } else {
        (ArmFrame::TPose, t_pose)
    })
}

/// Limbs whose two sides may be exchanged: what they are called, and their segments without the side.
const LIMBS: [(&str, &[&str]); 4] = [
    ("forearm and hand", &["ForeArm", "Hand"]),
    ("arm", &["UpperArm", "ForeArm", "Hand"]),
    ("shank and foot", &["LowerLeg", "Foot", "Toe"]),
    ("leg", &["UpperLeg", "LowerLeg", "Foot", "Toe"]),
];
/// Largest share of the distance between segments that may be left if exchanged sides are the reason.
const LEFT_OVER: f64 = 0.3;

/// Largest distance (m) between the two sides of a joint if the orientations were others.
fn closure<'a>(
    skeleton: &Skeleton,
    frames: impl Iterator<Item = &'a Frame>,
    other: impl Fn(&[f64]) -> Vec<f64>,
) -> f64 {
    let each = frames.filter_map(|frame| {
        let orientation = other(frame.numbers(Field::Orientation)?);
        let position = frame.numbers(Field::Position)?;
        let closes = |arms| skeleton.closure_error(&orientation, position, arms);
        Some(closes(ArmFrame::TPose).min(closes(ArmFrame::Isb)))
    });
    each.fold(f64::NEG_INFINITY, f64::max)
}

/// Says which limb's sides are exchanged, if the segments, which are `apart` (m), meet with them changed back.
pub(super) fn exchanged<'a>(
    skeleton: &Skeleton,
    header: &Header,
    frames: impl Iterator<Item = &'a Frame> + Clone,
    apart: f64,
) -> Option<String> {
    let changed_back = |segments: &[&str]| {
        let index = |side: &str, name: &str| header.segment_index(&format!("{side}{name}"));
        let both = |name: &&str| index("Left", name).zip(index("Right", name));
        let places: Vec<(usize, usize)> = segments.iter().filter_map(both).collect();
        closure(skeleton, frames.clone(), |orientation| {
            let mut changed = orientation.to_vec();
            // A recording without orientations of all segments has segments that do not meet.
            let (quaternions, _) = changed.as_chunks_mut::<4>();
            for &(left, right) in &places {
                if left.max(right) < quaternions.len() {
                    quaternions.swap(left, right);
                }
            }
            changed
        })
    };
    let all = LIMBS.map(|(limb, segments)| (limb, changed_back(segments)));
    let closed = all.into_iter().filter(|(_, left)| *left >= 0.0);
    let (limb, left) = closed.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (left < CLOSURE_LIMIT.min(LEFT_OVER * apart)).then(|| {
        format!(
            "left and right {limb} are exchanged: changed back, they are {left:.3} m apart. Change their sensors or labels, \
             and export the recording again"
        )
    })
}

/// The error for segments that do not meet; if they would with the quaternions in another order, or with both sides of a
/// limb exchanged, it says so.
pub(super) fn open_joints(
    skeleton: &Skeleton,
    header: &Header,
    frames: &[&Frame],
    closure_error: f64,
) -> Problem {
    let all = || frames.iter().copied();
    let reordered = closure(skeleton, all(), |orientation| {
        let each = orientation.chunks_exact(4);
        each.flat_map(|q| [q[3], q[0], q[1], q[2]]).collect()
    });
    let first = frames.first().map_or(0, |frame| frame.index);
    let problem = Problem::bad_input(format!(
        "the segments do not meet at their joints: {closure_error:.3} m apart, expected below {CLOSURE_LIMIT} m"
    ))
    .at(format!("frame {first} and after"));
    if (0.0..CLOSURE_LIMIT).contains(&reordered) {
        return problem.help(format!(
            "read as x y z w, the quaternions close the joints to {reordered:.4} m: write them as w x y z"
        ));
    }
    if let Some(said) = exchanged(skeleton, header, all(), closure_error) {
        return problem.help(said);
    }
    problem.help("orientations must be quaternions w x y z of the same subject as the points")
}
