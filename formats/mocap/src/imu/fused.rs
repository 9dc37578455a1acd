//! Readings from what a sensor's own fusion made of them: orientation and acceleration without gravity.

use bodyflight_core::air::STANDARD_GRAVITY;
use nalgebra::{UnitQuaternion, Vector3};

/// Follows the orientations of one sensor.
#[derive(Default)]
pub(super) struct Turning {
    last: Option<(f64, UnitQuaternion<f64>)>,
}

impl Turning {
    /// Mean angular velocity since the last orientation (rad/s, sensor axes), from the orientation (level axes from sensor) at a
    /// time (s); `None` for the first one, and for one that is not finite.
    pub(super) fn rate(&mut self, time: f64, turn: &UnitQuaternion<f64>) -> Option<Vector3<f64>> {
        if !(time.is_finite() && turn.coords.norm().is_finite()) {
            return None;
        }
        let before = self.last.replace((time, *turn));
        let (last, before) = before?;
        Some((before.inverse() * turn).scaled_axis() / (time - last))
    }
}

/// Specific force (m/s2, sensor axes) from an acceleration without gravity (m/s2, level axes).
pub(super) fn with_gravity(turn: &UnitQuaternion<f64>, free: &Vector3<f64>) -> Vector3<f64> {
    turn.inverse() * (free + Vector3::z() * STANDARD_GRAVITY)
}

/// Specific force (m/s2, sensor axes) from an acceleration without gravity (m/s2) in the sensor's own axes.
pub(super) fn pulled(turn: &UnitQuaternion<f64>, linear: &Vector3<f64>) -> Vector3<f64> {
    linear + turn.inverse() * (Vector3::z() * STANDARD_GRAVITY)
}
