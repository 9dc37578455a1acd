//! The convention of the arms, found from how well the segments meet.

use std::collections::VecDeque;

use super::plausibility::JOINT_LIMIT;
use crate::closure::Skeleton;
use crate::{ArmFrame, Field, Frame, FrameKind};
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

/// The error for segments that do not meet; if they would with the quaternions in another order, the advice says so.
pub(super) fn open_joints(
    skeleton: &Skeleton,
    frames: &VecDeque<Frame>,
    closure_error: f64,
) -> Problem {
    let reordered = frames.iter().filter_map(|frame| {
        let orientation = frame.numbers(Field::Orientation)?;
        let position = frame.numbers(Field::Position)?;
        let from_xyzw: Vec<f64> = orientation
            .chunks_exact(4)
            .flat_map(|q| [q[3], q[0], q[1], q[2]])
            .collect();
        let closes = |arms| skeleton.closure_error(&from_xyzw, position, arms);
        Some(closes(ArmFrame::TPose).min(closes(ArmFrame::Isb)))
    });
    let reordered = reordered.fold(f64::NEG_INFINITY, f64::max);
    let first = frames.front().map_or(0, |frame| frame.index);
    let problem = Problem::bad_input(format!(
        "the segments do not meet at their joints: {closure_error:.3} m apart, expected below {CLOSURE_LIMIT} m"
    ))
    .at(format!("frame {first} and after"));
    if (0.0..CLOSURE_LIMIT).contains(&reordered) {
        return problem.help(format!(
            "read as x y z w, the quaternions close the joints to {reordered:.4} m: write them as w x y z"
        ));
    }
    problem.help("orientations must be quaternions w x y z of the same subject as the points")
}
