//! Segments whose attitude jumps from one frame to the next: an exchanged limb, or a marker that slipped.

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::{UnitQuaternion, Vector3};

/// Smallest jump (rad), and smallest ratio to what 95 of 100 frames of the segment do.
const LEAST: f64 = 0.1;
const USUAL: f64 = 5.0;
/// Hands, feet and head may jump by this many times more: their few markers lie close together.
const ENDS: f64 = 2.0;
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
            if *jump > limit && is_peak {
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
