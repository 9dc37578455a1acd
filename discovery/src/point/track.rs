//! The way of a point in memory.

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

/// A recording of a point.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Track {
    /// In the order of time.
    pub fixes: Vec<Fix>,
    /// Specific force by an inertial sensor (m/s2, its own axes), with its time on the clock of the fixes (s); empty
    /// where there is no such sensor.
    pub specific_force: Vec<(f64, Vector3<f64>)>,
    /// Rows of the files that were not usable.
    pub rows_skipped: usize,
}
