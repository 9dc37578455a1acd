//! Noise of the sensors of a recording, sample by sample.

/// Standard deviations of the sensor noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorNoise {
    /// Attitude of the pelvis, each axis (rad).
    pub attitude: f64,
    /// Angular velocity, each axis (rad/s).
    pub angular_velocity: f64,
    /// Horizontal velocity, each axis (m/s).
    pub horizontal_velocity: f64,
    /// Vertical velocity (m/s).
    pub vertical_velocity: f64,
    /// Each joint, each axis (rad): slowly varying errors of the sensor fusion.
    pub joint: f64,
}

impl SensorNoise {
    /// Sensors without noise.
    pub const NONE: Self = Self {
        attitude: 0.0,
        angular_velocity: 0.0,
        horizontal_velocity: 0.0,
        vertical_velocity: 0.0,
        joint: 0.0,
    };

    /// The paper's figures, sections "Measurements" and "Discussion": angles 0.01 rad, rates 0.03 rad/s, velocity 0.1
    /// m/s with GNSS and 1 m/s vertically. Joints are taken as exact, because their error is a bias of the posture and
    /// not noise.
    pub const PAPER: Self = Self {
        attitude: 0.01,
        angular_velocity: 0.03,
        horizontal_velocity: 0.1,
        vertical_velocity: 1.0,
        joint: 0.0,
    };

    /// Multiplies all standard deviations by `factor`.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            attitude: self.attitude * factor,
            angular_velocity: self.angular_velocity * factor,
            horizontal_velocity: self.horizontal_velocity * factor,
            vertical_velocity: self.vertical_velocity * factor,
            joint: self.joint * factor,
        }
    }
}
