//! Vertical velocity from a barometer's height: its change over about a second.

use super::measurement::SensorMeasurement;
use super::sensors::Barometer;
use crate::math::Real;

/// Time over which the height's change is taken (s): with a noise of 0.3 m, it gives the velocity to 0.4 m/s.
const SPAN: f32 = 1.0;
/// Longest time between two heights of which the change is used (s).
const LONGEST: f32 = 2.0;
/// Acceleration by which the velocity at the end may differ from the mean (m/s2).
const CHANGING: f32 = 2.0;

/// The height at the beginning of the span.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Climb<T> {
    from: Option<T>,
    elapsed: T,
}

impl<T: Real> Climb<T> {
    pub(super) fn new() -> Self {
        Self {
            from: None,
            elapsed: T::zero(),
        }
    }

    /// Returns the measurement with a vertical velocity where a height has changed over the span.
    pub(super) fn with_rate(
        &mut self,
        measured: &SensorMeasurement<T>,
        duration: T,
    ) -> SensorMeasurement<T> {
        self.elapsed += duration;
        let mut with = *measured;
        let Some(read) = measured.barometer else {
            return with;
        };
        let Some(height) = read.height.filter(|_| read.vertical_velocity.is_none()) else {
            return with;
        };
        let (Some(from), true) = (self.from, self.elapsed <= T::single(LONGEST)) else {
            self.from = Some(height);
            self.elapsed = T::zero();
            return with;
        };
        if self.elapsed >= T::single(SPAN) {
            let noise = read.height_deviation / self.elapsed;
            let lag = T::single(0.5 * CHANGING) * self.elapsed;
            with.barometer = Some(Barometer {
                vertical_velocity: Some((height - from) / self.elapsed),
                vertical_velocity_deviation: (noise * noise * T::of(2.0) + lag * lag).root(),
                ..read
            });
            self.from = Some(height);
            self.elapsed = T::zero();
        }
        with
    }
}
