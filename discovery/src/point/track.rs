//! The track of a point.

use bodyflight_core::frame::{Inertial, Vector};
use nalgebra::Vector3;

/// One fix of a receiver.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Time (s).
    pub time: f64,
    /// Position (m); height above mean sea level.
    pub position: Vector<f64, Inertial>,
    /// Velocity over ground (m/s).
    pub velocity: Vector<f64, Inertial>,
}

/// The track of a point, as recorded.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// Fixes in order of time.
    pub fixes: Vec<Fix>,
    /// Specific force measured by an inertial sensor (m/s2, sensor axes), with its time on the clock of the fixes (s).
    /// Empty if there is no such sensor.
    pub specific_force: Vec<(f64, Vector3<f64>)>,
    /// Number of rows of the files that were unusable.
    pub rows_skipped: usize,
}
