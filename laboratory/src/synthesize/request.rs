//! What to synthesise.

use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::sensor_noise::SensorNoise;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject::Subject;

/// Size of the involuntary sway of each joint of a relaxed skydiver (rad).
pub const DEFAULT_SWAY: f64 = 0.02;

/// Errors of the recorded joints that are slower than noise, standard deviations of each axis (rad).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointError {
    /// Constant over the flight.
    pub calibration: f64,
    /// Wandering at 0.08 to 0.5 Hz.
    pub wander: f64,
}

/// What to synthesise.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// The script.
    pub maneuver: &'static Maneuver,
    /// The person.
    pub subject: &'a Subject,
    /// Air density (kg/m3).
    pub density: f64,
    /// Seed of sway and noise.
    pub seed: u64,
    /// Sensor noise.
    pub noise: SensorNoise,
    /// Errors of the recorded joints.
    pub joint_error: JointError,
    /// Size of the involuntary sway of each joint (rad).
    pub sway: f64,
    /// Whether to fly in a wind tunnel, with an airflow as fast as the subject's neutral fall.
    pub tunnel: bool,
}

impl<'a> Request<'a> {
    /// A maneuver in free fall as the suit of the paper records it: its noise, no slow errors, the usual sway and air.
    pub fn new(maneuver: &'static Maneuver, subject: &'a Subject, seed: u64) -> Self {
        Self {
            maneuver,
            subject,
            density: DEFAULT_DENSITY,
            seed,
            noise: SensorNoise::PAPER,
            joint_error: JointError::default(),
            sway: DEFAULT_SWAY,
            tunnel: false,
        }
    }

    /// Checks that all numbers are in range.
    ///
    /// # Errors
    /// Returns an error that names the first number out of range, and its range.
    pub fn check(&self) -> Result<()> {
        if !(self.density > 0.0 && self.density <= 2.0) {
            return Err(Problem::bad_input(format!(
                "expected a density above 0 and up to 2 kg/m3, found {}",
                self.density
            )));
        }
        let degrees = |angle: f64| (angle.to_degrees(), 20.0);
        for (name, (value, high)) in [
            (
                "sensor noise, in shares of the paper's,",
                (self.noise.attitude / SensorNoise::PAPER.attitude, 100.0),
            ),
            (
                "an error of the joints (deg)",
                degrees(self.joint_error.calibration),
            ),
            (
                "a wander of the joints (deg)",
                degrees(self.joint_error.wander),
            ),
        ] {
            if !(0.0..=high).contains(&value) {
                return Err(Problem::bad_input(format!(
                    "expected {name} of 0 to {high}, found {value}"
                )));
            }
        }
        Ok(())
    }
}
