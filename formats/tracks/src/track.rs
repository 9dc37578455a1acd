//! A track, whatever its format.

use bodyflight_falls::Sample;
use bodyflight_falls::channels::Given;
use nalgebra::Vector3;

/// A track, with the data of the logger's other sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// The format, by its name.
    pub format: &'static str,
    /// In order of time; velocities are zero if they are not given.
    pub samples: Vec<Sample>,
    /// Accuracy of the velocity of each sample as the receiver states it (m/s); empty if the format has none.
    pub speed_accuracy: Vec<Option<f64>>,
    /// Accuracy of each position as the receiver states it, of the place or the height, whichever is worse (m); empty if the
    /// format has none.
    pub position_accuracy: Vec<Option<f64>>,
    /// Time of the first sample since 1970 (s, UTC); `None` if the file has no date.
    pub start: Option<f64>,
    /// What the file contains.
    pub given: Given,
    /// Samples of the inertial sensor, each with its time (s) on the clock of `samples`.
    pub inertial: Vec<(f64, InertialSample)>,
    /// Samples of the barometer: time (s) on the clock of `samples`, and pressure (Pa).
    pub pressure: Vec<(f64, f64)>,
    /// Number of rows skipped: unusable, or not later than the row before.
    pub skipped: usize,
    /// What was mended or left out while reading, in sentences.
    pub notes: Vec<String>,
}

/// One sample of the inertial sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InertialSample {
    /// Time in the week (s).
    pub time_of_week: f64,
    /// Specific force, axes of the device (m/s2).
    pub specific_force: Vector3<f64>,
    /// Angular velocity, axes of the device (rad/s).
    pub angular_velocity: Vector3<f64>,
}
