//! A frame of a flight.

use bodyflight_core::Posture;
use bodyflight_core::dynamics::Motion;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::{Body, Inertial, Rotation, Vector};

use crate::Field;
use bodyflight_io::diagnostic::{Problem, Result};

/// One instant of a flight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightFrame {
    /// Number of the frame in the recording.
    pub index: u64,
    /// Time since frame 0 (s): index divided by frame rate.
    pub time: f64,
    /// Posture of the body.
    pub posture: Posture<f64>,
    /// Motion of the pelvis.
    pub pelvis: PelvisMotion,
    /// Centre of mass as MVN estimates it (m).
    pub centre_of_mass: Option<Vector<f64, Inertial>>,
    /// Whether the frame replaces a bad one.
    pub bridged: bool,
}

/// Motion of the pelvis, the root of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PelvisMotion {
    /// Attitude.
    pub inertial_from_body: Rotation<f64, Inertial, Body>,
    /// Position of its origin (m).
    pub position: Vector<f64, Inertial>,
    /// Velocity of its origin (m/s), if the file has it.
    pub velocity: Option<Vector<f64, Inertial>>,
    /// Angular velocity (rad/s), if the file has it.
    pub angular_velocity: Option<Vector<f64, Inertial>>,
}

impl FlightFrame {
    /// A frame that records the given motion.
    pub fn from_motion(index: u64, time: f64, posture: Posture<f64>, motion: &Motion<f64>) -> Self {
        Self {
            index,
            time,
            posture,
            pelvis: PelvisMotion {
                inertial_from_body: motion.inertial_from_body,
                position: motion.position,
                velocity: Some(motion.velocity_inertial()),
                angular_velocity: Some(motion.inertial_from_body * motion.angular_velocity),
            },
            centre_of_mass: None,
            bridged: false,
        }
    }

    /// The motion of the pelvis in body axes.
    ///
    /// # Errors
    /// Returns an error if the recording has no velocity or angular velocity.
    pub fn motion(&self) -> Result<Motion<f64>> {
        let (velocity, angular_velocity) = self.rates()?;
        let inertial_from_body = self.pelvis.inertial_from_body;
        let body_from_inertial = inertial_from_body.inverse();
        Ok(Motion {
            inertial_from_body,
            position: self.pelvis.position,
            velocity: body_from_inertial * velocity,
            angular_velocity: body_from_inertial * angular_velocity,
        })
    }

    /// Time, posture and motion, in body axes.
    ///
    /// # Errors
    /// Returns an error if the recording has no velocity or angular velocity.
    pub fn sample(&self) -> Result<FlightSample> {
        Ok(FlightSample {
            time: self.time,
            posture: self.posture,
            motion: self.motion()?,
        })
    }

    /// Velocity (m/s) and angular velocity (rad/s) of the pelvis, for callers that require both.
    ///
    /// # Errors
    /// Returns an error if the file lacks one of them; it says which, and how to get it.
    pub fn rates(&self) -> Result<(Vector<f64, Inertial>, Vector<f64, Inertial>)> {
        let missing = |field: Field| {
            let element = field.element();
            Problem::bad_input(format!(
                "the recording has no <{element}>, which is needed here"
            ))
            .at(format!("frame {}", self.index))
            .help(format!(
                "export it again from MVN with <{element}> of the segments included"
            ))
        };
        let pelvis = &self.pelvis;
        Ok((
            pelvis.velocity.ok_or_else(|| missing(Field::Velocity))?,
            pelvis
                .angular_velocity
                .ok_or_else(|| missing(Field::AngularVelocity))?,
        ))
    }
}
