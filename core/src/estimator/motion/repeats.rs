//! Detects stuck sensors: a sensor with noise never repeats the same value for long.

use super::measurement::{MotionMeasurement, RECORDED_CHANNELS};
use crate::math::Real;

/// Time for which a sensor may repeat the same value and still be used (s).
pub const BELIEVED: f32 = 0.25;

/// Number of sensors watched: attitude, angular velocity, velocity.
const SENSORS: usize = 3;

/// Time for which each sensor has repeated its value.
///
/// Receivers and barometers are not checked, since they repeat their value until the next solution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeats<T> {
    last: [[T; 4]; SENSORS],
    times: [T; SENSORS],
}

impl<T: Real> Repeats<T> {
    /// Creates the state before any measurement.
    pub fn new() -> Self {
        Self {
            last: [[T::zero(); 4]; SENSORS],
            times: [T::zero(); SENSORS],
        }
    }

    /// Processes a measurement taken `duration` (s) after the last one.
    pub fn take(&mut self, measured: &MotionMeasurement<T>, duration: T) {
        let vector = |[x, y, z]: [T; 3]| [x, y, z, T::zero()];
        let values = [
            measured
                .inertial_from_body
                .map(|attitude| attitude.quaternion().coords.into()),
            measured
                .angular_velocity
                .map(|spin| vector(spin.components.into())),
            measured
                .velocity
                .map(|velocity| vector(velocity.components.into())),
        ];
        for (sensor, value) in values.into_iter().enumerate() {
            let Some(value) = value else {
                self.times[sensor] = T::zero();
                continue;
            };
            if value == self.last[sensor] {
                self.times[sensor] += duration;
            } else {
                self.times[sensor] = T::zero();
            }
            self.last[sensor] = value;
        }
    }

    /// Returns the time for which the sensor of a channel has repeated its value (s).
    pub fn time(&self, channel: usize) -> T {
        if channel < RECORDED_CHANNELS {
            self.times[channel / 3]
        } else {
            T::zero()
        }
    }
}

impl<T: Real> Default for Repeats<T> {
    fn default() -> Self {
        Self::new()
    }
}
