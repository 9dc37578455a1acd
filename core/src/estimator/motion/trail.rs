//! How the model's velocity changed over the last intervals, to compare a measurement with the instant it describes.

use nalgebra::Vector3;

use crate::math::Real;

/// Number of intervals kept: a quarter of a second at 240 Hz with two samples each.
const LENGTH: usize = 32;

/// Changes of the pelvic joint's velocity (m/s, inertial axes) in the last intervals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trail<T: Real> {
    changes: [Vector3<T>; LENGTH],
    /// Index of the oldest change, which the next one replaces.
    next: usize,
}

impl<T: Real> Trail<T> {
    /// A trail of no changes.
    pub fn new() -> Self {
        Self {
            changes: [Vector3::zeros(); LENGTH],
            next: 0,
        }
    }

    /// Adds the change of the velocity over an interval.
    pub fn push(&mut self, change: Vector3<T>) {
        if let Some(oldest) = self.changes.get_mut(self.next) {
            *oldest = change;
        }
        self.next = (self.next + 1) % LENGTH;
    }

    /// Returns the change of the velocity over the last `age` (in intervals), and the part of the age that lies before
    /// the trail (in intervals).
    pub fn since(&self, age: T) -> (Vector3<T>, T) {
        let mut left = if age > T::zero() { age } else { T::zero() };
        let mut sum = Vector3::zeros();
        let (newer, older) = self.changes.split_at(self.next.min(LENGTH));
        for change in newer.iter().rev().chain(older.iter().rev()) {
            let share = if left < T::one() { left } else { T::one() };
            sum += change * share;
            left -= share;
        }
        (sum, left)
    }
}

impl<T: Real> Default for Trail<T> {
    fn default() -> Self {
        Self::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_changes_are_summed_in_order() {
        let mut trail = Trail::<f64>::new();
        for k in 1..=100 {
            trail.push(Vector3::new(f64::from(k), 0.0, 0.0));
        }
        assert!((trail.since(0.5).0.x - 50.0).abs() < 1e-12);
        assert!((trail.since(2.0).0.x - 199.0).abs() < 1e-12);
        let (sum, left) = trail.since(40.0);
        assert!((sum.x - (69..=100).sum::<i32>() as f64).abs() < 1e-12);
        assert!((left - 8.0).abs() < 1e-12);
        assert!(trail.since(-1.0).0.x.abs() < 1e-12);
    }
}
