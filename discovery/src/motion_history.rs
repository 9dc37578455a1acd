//! A history of recent motion, for sensors that lag.

use std::collections::VecDeque;

use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::sensors::Moving;

/// Velocity and angular velocity over time.
#[derive(Debug, Clone, Default)]
pub struct MotionHistory {
    moments: VecDeque<(f64, Moving<f64>)>,
}

impl MotionHistory {
    /// Adds velocities at `time` (s), which must be later than all before.
    pub fn push(&mut self, time: f64, moving: Moving<f64>) {
        self.moments.push_back((time, moving));
    }

    /// Adds a motion and drops entries older than `span` (s), but keeps the one before that point and at least two in
    /// all.
    pub fn push_within(&mut self, time: f64, motion: &Motion<f64>, span: f64) {
        self.push(time, Moving::of(motion));
        while self.moments.len() > 2 && self.moments[1].0 < time - span {
            self.moments.pop_front();
        }
    }

    /// The velocities at `time` (s), interpolated or extrapolated linearly from the two nearest entries.
    pub fn at(&self, time: f64) -> Option<Moving<f64>> {
        let last = self.moments.len().checked_sub(1)?;
        let after = self.moments.partition_point(|(moment, _)| *moment < time);
        let upper = after.clamp(1.min(last), last);
        let (from, to) = (&self.moments[upper.saturating_sub(1)], &self.moments[upper]);
        let duration = to.0 - from.0;
        if duration > 0.0 {
            Some(from.1.towards(&to.1, (time - from.0) / duration))
        } else {
            Some(to.1)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::frame::Vector;

    fn moving(north: f64) -> Moving<f64> {
        Moving {
            velocity: Vector::new(north, 0.0, 0.0),
            angular_velocity: Vector::new(0.0, -north, 0.0),
        }
    }

    fn north(history: &MotionHistory, time: f64) -> f64 {
        history.at(time).unwrap().velocity.x()
    }

    #[test]
    fn times_between_points_are_interpolated_and_later_ones_extrapolated() {
        let mut history = MotionHistory::default();
        assert!(history.at(0.0).is_none());
        history.push(0.0, moving(1.0));
        assert!((north(&history, 3.0) - 1.0).abs() < 1e-12);
        history.push(1.0, moving(3.0));
        history.push(2.0, moving(7.0));
        for (time, expected) in [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0), (1.5, 5.0), (3.0, 11.0)] {
            assert!((north(&history, time) - expected).abs() < 1e-12, "{time}");
        }
        assert!((north(&history, -1.0) + 1.0).abs() < 1e-12);
    }
}
