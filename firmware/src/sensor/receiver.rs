//! Whether a receiver's solutions can be believed: one that repeats itself has stopped, and one that is later than usual
//! says so by its own time.

use nalgebra::Vector3;

/// A receiver's velocity that has not been attached to a sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Solution {
    /// In inertial axes (m/s).
    pub(super) velocity: Vector3<f32>,
    pub(super) speed: f32,
    /// Standard deviation (m/s).
    pub(super) deviation: f32,
    /// Time at which it arrived (us, the board's clock), and its age then (s).
    pub(super) arrived: u64,
    pub(super) age: f32,
}

/// Number of times that a receiver in motion may repeat a velocity, and one component of it, which it gives to the millimetre
/// per second.
const REPEATS: (u8, u8) = (2, 3);
/// Difference of the two clocks by which an epoch of the receiver begins (ms): its week ended, or it found the time.
const EPOCH: i32 = 10_000;
/// Time in which the clocks drift apart by a millisecond at most (ms): 50 ppm.
const DRIFT: i32 = 20_000;

/// What is kept of a receiver's solutions.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Receiver {
    last: Option<Last>,
    /// How often each component has been repeated.
    repeats: [u8; 3],
}

#[derive(Debug, Clone, Copy)]
struct Last {
    velocity: Vector3<f32>,
    time_of_week: u32,
    /// Time of arrival less that of the receiver for the promptest solution so far, and when it was taken (ms; wrap).
    least: Option<(i32, u32)>,
}

impl Receiver {
    /// Whether the receiver still measures, after a solution with this velocity (m/s) on somebody who moves or does not: at
    /// rest receivers hold their position.
    pub(super) fn measures(&mut self, velocity: &Vector3<f32>, is_moving: bool) -> bool {
        for (axis, repeats) in self.repeats.iter_mut().enumerate() {
            let is_same = is_moving
                && (self.last)
                    .is_some_and(|last| last.velocity[axis].to_bits() == velocity[axis].to_bits());
            *repeats = if is_same {
                repeats.saturating_add(1)
            } else {
                0
            };
        }
        if let Some(last) = &mut self.last {
            last.velocity = *velocity;
        } else {
            self.last = Some(Last {
                velocity: *velocity,
                time_of_week: 0,
                least: None,
            });
        }
        let (whole, component) = REPEATS;
        self.repeats.iter().any(|repeats| *repeats < whole)
            && self.repeats.iter().all(|repeats| *repeats < component)
    }

    /// By how much longer than the promptest one a solution was on its way (s), that of the receiver's time `time_of_week`
    /// and arrives at `now` (both ms).
    pub(super) fn lateness(&mut self, time_of_week: u32, now: u32) -> f32 {
        let Some(last) = &mut self.last else {
            return 0.0;
        };
        let is_new = core::mem::replace(&mut last.time_of_week, time_of_week) != time_of_week;
        if !is_new {
            return 0.0;
        }
        let difference = now.wrapping_sub(time_of_week).cast_signed();
        let late = last.least.map(|(least, taken)| {
            let drift = now.wrapping_sub(taken).cast_signed() / DRIFT;
            difference.wrapping_sub(least.wrapping_add(drift))
        });
        let Some(late) = late.filter(|late| (0..EPOCH).contains(late)) else {
            last.least = Some((difference, now));
            return 0.0;
        };
        // Exact: below 2^24.
        late as f32 * 1e-3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_solution_is_as_late_as_the_receivers_own_time_says() {
        let mut receiver = Receiver::default();
        let mut late = |time_of_week, now: u32| {
            receiver.measures(&Vector3::x(), false);
            receiver.lateness(time_of_week, now)
        };
        let week = 604_800_000;
        let start = u32::MAX - 1_000;
        for (time_of_week, after, expected) in [
            (week - 1_000, 0, 0.0),
            (week - 800, 230, 0.03),
            (week - 600, 380, 0.0),
            (week - 400, 1_080, 0.5),
            // The next week, and a receiver that has no time.
            (0, 1_400, 0.0),
            (200, 2_100, 0.5),
            (200, 2_300, 0.0),
        ] {
            let found = late(time_of_week, start.wrapping_add(after));
            assert!((found - expected).abs() < 1e-6, "{after}: {found}");
        }
    }

    #[test]
    fn the_first_solution_is_taken_as_prompt() {
        let mut receiver = Receiver::default();
        for (time_of_week, now) in [(1_000, 4_100), (1_200, 4_300)] {
            receiver.measures(&Vector3::x(), false);
            assert!(receiver.lateness(time_of_week, now) < 1e-6);
        }
    }

    #[test]
    fn a_receiver_that_repeats_its_velocity_in_flight_has_stopped() {
        let mut receiver = Receiver::default();
        let falling = Vector3::new(3.0, 1.0, -50.0);
        let heard = [falling; 4].map(|velocity| receiver.measures(&velocity, true));
        assert_eq!(heard, [true, true, false, false]);
        assert!(receiver.measures(&Vector3::x(), true));
        let north_alone = [0.1, 0.2, 0.3, 0.4, 0.5].map(|up| Vector3::new(3.0, up, up - 50.0));
        let heard = north_alone.map(|velocity| receiver.measures(&velocity, true));
        assert_eq!(heard, [true, true, true, false, false]);
        assert!(
            [Vector3::zeros(); 9]
                .iter()
                .all(|still| receiver.measures(still, false))
        );
    }
}
