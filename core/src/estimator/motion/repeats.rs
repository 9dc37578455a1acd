//! Whether a sensor still measures: one that has noise never says the same number twice for long.

use super::measurement::{CHANNELS, MotionMeasurement};
use crate::math::Real;

/// Time for which a sensor may say the same and be believed (s).
pub const BELIEVED: f32 = 0.25;

/// Attitude, angular velocity, velocity.
const SENSORS: usize = 3;

/// For how long each sensor has repeated itself.
///
/// The speed of satellites is not looked at: receivers repeat it until they have the next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Repeats<T> {
    last: [[T; 4]; SENSORS],
    times: [T; SENSORS],
}

impl<T: Real> Repeats<T> {
    /// Nothing measured.
    pub fn new() -> Self {
        Self {
            last: [[T::zero(); 4]; SENSORS],
            times: [T::zero(); SENSORS],
        }
    }

    /// Takes in what was measured `duration` (s) after the last.
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

    /// For how long the sensor of a channel has said the same (s).
    pub fn time(&self, channel: usize) -> T {
        if channel + 1 < CHANNELS {
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
