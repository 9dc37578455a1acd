//! Knees that bend the wrong way, which shows a wrong mapping.

use bodyflight_core::{Posture, Segment};
use nalgebra::Vector3;

/// If the knees are bent the wrong way by more than this (rad) in more than half of the frames, the mapping is wrong.
const KNEE: f64 = 0.2;

/// Counts frames in which a knee is bent the wrong way.
#[derive(Debug, Default)]
pub(super) struct Knees {
    pub(super) frames: u64,
    pub(super) wrong: u64,
}

impl Knees {
    pub(super) fn see(&mut self, posture: &Posture<f64>) {
        let is_wrong = |shank: Segment| {
            let down = posture.parent_from_segment(shank) * -Vector3::z();
            // The heel goes backwards, which is dorsal.
            down.y < -KNEE.sin()
        };
        self.frames += 1;
        self.wrong += u64::from(is_wrong(Segment::LeftShank) || is_wrong(Segment::RightShank));
    }
}
