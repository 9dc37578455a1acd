//! Segments whose attitude jumps from one frame to the next and stays there: an exchanged limb, or a marker that slipped.
//! Single frames that come back, and fast motion over several frames, are no jumps.

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::{UnitQuaternion, Vector3};

/// Smallest jump (rad), and smallest ratio to what 95 of 100 frames of the segment do.
const LEAST: f64 = 0.1;
const USUAL: f64 = 5.0;
/// Hands, feet and head may jump by this many times more: their few markers lie close together.
const ENDS: f64 = 2.0;
/// Frames before and after a jump, beyond its neighbours, that show how the segment turns anyhow, and the smallest ratio
/// of what the jump leaves behind to the largest of their differences.
const AROUND: usize = 3;
const ABOVE: f64 = 3.0;
/// Smallest part of what a jump leaves behind that happens in a single frame.
const SUDDEN: f64 = 0.75;
/// Jumps within this time belong together (s).
const TOGETHER: f64 = 0.05;

/// Segments that jump at one time.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    /// Time (s).
    pub(super) time: f64,
    /// The segments with the size of their jump (rad), the largest first.
    pub(super) segments: Vec<(Segment, f64)>,
}

/// The jumps of a recording in order of time.
pub(super) fn found(frames: &[FlightFrame]) -> Vec<Step> {
    let turned: Vec<SegmentArray<UnitQuaternion<f64>>> = (frames.iter())
        .map(|frame| {
            let attitude = *frame.pelvis.inertial_from_body.quaternion();
            (frame.posture.body_from_segments()).map(|_, segment| attitude * segment)
        })
        .collect();
    let mut jumps: Vec<(f64, Segment, f64)> = Vec::new();
    for segment in Segment::ALL {
        let turns: Vec<Vector3<f64>> = (turned.windows(2))
            .map(|pair| (pair[1][segment] * pair[0][segment].inverse()).scaled_axis())
            .collect();
        // What a rotation has beyond the mean of those before and after it.
        let beyond: Vec<f64> = (turns.windows(3))
            .map(|three| (three[1] - (three[0] + three[2]) * 0.5).norm())
            .collect();
        let mut sorted = beyond.clone();
        sorted.sort_by(f64::total_cmp);
        let usual = sorted.get(sorted.len() * 95 / 100).copied().unwrap_or(0.0);
        let is_end = !Segment::ALL
            .iter()
            .any(|other| other.parent() == Some(segment));
        let limit = (LEAST * if is_end { ENDS } else { 1.0 }).max(USUAL * usual);
        for (k, jump) in beyond.iter().enumerate() {
            let is_peak = [k.wrapping_sub(1), k + 1]
                .iter()
                .all(|near| beyond.get(*near).is_none_or(|near| near <= jump));
            if *jump > limit && is_peak && stays(&turns, k + 1, *jump, limit) {
                jumps.push((frames[k + 2].time, segment, *jump));
            }
        }
    }
    jumps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let groups = jumps.chunk_by(|a, b| b.0 - a.0 < TOGETHER);
    groups
        .map(|group| {
            let mut segments: Vec<(Segment, f64)> =
                group.iter().map(|(_, s, jump)| (*s, *jump)).collect();
            segments.sort_by(|a, b| b.1.total_cmp(&a.1));
            Step {
                time: group[0].0,
                segments,
            }
        })
        .collect()
}

/// Whether a turn of the segment is a jump that stays: what it and its neighbours have beyond those around them is large,
/// and nearly all of it happened at once.
fn stays(turns: &[Vector3<f64>], at: usize, jump: f64, limit: f64) -> bool {
    let before = at.saturating_sub(1 + AROUND)..at.saturating_sub(1);
    let after = (at + 2).min(turns.len())..(at + 2 + AROUND).min(turns.len());
    let around: Vec<Vector3<f64>> = [&turns[before], &turns[after]].concat();
    let usual = around.iter().sum::<Vector3<f64>>() / around.len().max(1) as f64;
    let near = &turns[at.saturating_sub(1)..(at + 2).min(turns.len())];
    let left = near
        .iter()
        .map(|turn| turn - usual)
        .sum::<Vector3<f64>>()
        .norm();
    let differs = around
        .iter()
        .map(|turn| (turn - usual).norm())
        .fold(0.0, f64::max);
    left > limit && left > ABOVE * differs && jump > SUDDEN * left
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Turns about one axis (rad).
    fn stays_after(turns: &[f64], at: usize) -> bool {
        let turns: Vec<Vector3<f64>> = turns.iter().map(|turn| Vector3::x() * *turn).collect();
        let jump = (turns[at] - (turns[at - 1] + turns[at + 1]) * 0.5).norm();
        stays(&turns, at, jump, LEAST)
    }

    #[test]
    fn a_jump_stays_and_a_single_frame_or_fast_motion_does_not() {
        let slow = 0.02;
        assert!(stays_after(
            &[slow, slow, slow, slow, slow + 0.25, slow, slow, slow, slow],
            4
        ));
        assert!(!stays_after(
            &[
                slow,
                slow,
                slow,
                slow,
                slow + 0.25,
                slow - 0.25,
                slow,
                slow,
                slow
            ],
            4
        ));
        assert!(!stays_after(
            &[0.02, 0.05, 0.1, 0.18, 0.3, 0.18, 0.1, 0.05, 0.02],
            4
        ));
        // At the begin of a recording, fewer frames show how the segment turns.
        assert!(stays_after(&[slow, 0.3, slow, slow, slow, slow], 1));
    }
}
