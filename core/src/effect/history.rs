//! The recent course of a motion, for sensors that lag.

use crate::effect::sensors::Moving;
use crate::math::Real;

/// The velocities at `time` (s), interpolated or extrapolated linearly from the two nearest entries of a course, which is
/// given as pairs of a time and what moved, in order of time. Returns `None` if the course is empty.
pub fn moving_at<T: Real>(course: &[(T, Moving<T>)], time: T) -> Option<Moving<T>> {
    let last = course.len().checked_sub(1)?;
    let after = course.partition_point(|(moment, _)| *moment < time);
    let upper = after.clamp(1.min(last), last);
    let (from, to) = (course.get(upper.saturating_sub(1))?, course.get(upper)?);
    let duration = to.0 - from.0;
    if duration > T::zero() {
        Some(from.1.towards(&to.1, (time - from.0) / duration))
    } else {
        Some(to.1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::Vector;

    fn moving(north: f64) -> Moving<f64> {
        Moving {
            velocity: Vector::new(north, 0.0, 0.0),
            angular_velocity: Vector::new(0.0, -north, 0.0),
        }
    }

    fn north(course: &[(f64, Moving<f64>)], time: f64) -> f64 {
        moving_at(course, time).unwrap().velocity.x()
    }

    #[test]
    fn times_between_points_are_interpolated_and_later_ones_extrapolated() {
        assert!(moving_at::<f64>(&[], 0.0).is_none());
        let course = [(0.0, moving(1.0)), (1.0, moving(3.0)), (2.0, moving(7.0))];
        assert!((north(&course[..1], 3.0) - 1.0).abs() < 1e-12);
        for (time, expected) in [(0.0, 1.0), (0.5, 2.0), (1.0, 3.0), (1.5, 5.0), (3.0, 11.0)] {
            assert!((north(&course, time) - expected).abs() < 1e-12, "{time}");
        }
        assert!((north(&course, -1.0) + 1.0).abs() < 1e-12);
    }
}
