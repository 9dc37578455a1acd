//! The last moments of a motion, for sensors that lag.

use std::collections::VecDeque;

use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::history::moving_at;
use bodyflight_core::effect::sensors::Moving;

/// Velocity and angular velocity over a limited time.
#[derive(Debug, Clone, Default)]
pub(super) struct MotionHistory {
    moments: VecDeque<(f64, Moving<f64>)>,
}

impl MotionHistory {
    /// Adds a motion at `time` (s), which must be later than all before, and drops entries older than `span` (s), but
    /// keeps the one before that point and at least two in all.
    pub(super) fn push(&mut self, time: f64, motion: &Motion<f64>, span: f64) {
        self.moments.push_back((time, Moving::of(motion)));
        while self.moments.len() > 2 && self.moments[1].0 < time - span {
            self.moments.pop_front();
        }
        self.moments.make_contiguous();
    }

    /// The velocities at `time` (s).
    pub(super) fn at(&self, time: f64) -> Option<Moving<f64>> {
        moving_at(self.moments.as_slices().0, time)
    }
}
