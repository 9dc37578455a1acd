//! A flight in memory, as discovery wants it.

use bodyflight_core::Posture;
use bodyflight_core::dynamics::{Dynamics, Inputs, Motion};

use crate::diagnostic::{Problem, Result};
use crate::flight::Flight;
use crate::recording::{FlightFrame, Options, Recording};
use crate::simulate::measured_motion;

/// A recorded flight with the model that is meant to fly it.
#[derive(Debug, Clone)]
pub struct Track {
    /// Time of each frame (s).
    pub times: Vec<f64>,
    /// Recorded postures.
    pub postures: Vec<Posture<f64>>,
    /// Recorded motion of the pelvis.
    pub measured: Vec<Motion<f64>>,
    /// The model as it is believed to be.
    pub dynamics: Dynamics<f64>,
    /// The skydiver's inputs as they are believed to be.
    pub inputs: Inputs<f64>,
}

impl Track {
    /// Reads a flight.
    ///
    /// # Errors
    /// Where a file is not usable or has no velocities.
    pub fn read(flight: &Flight, options: Options) -> Result<Self> {
        let recording = Recording::open(&flight.recording, options)?;
        let frames = recording.collect::<Result<Vec<_>>>()?;
        let first = frames.first().ok_or_else(|| {
            Problem::bad_input("expected frames of type \"normal\"").in_file(&flight.recording)
        })?;
        let dynamics = flight.dynamics(first.pelvis.position.components.z);
        let inputs = Inputs {
            damping: flight.subject.damping(),
            ..Inputs::belly_turn()
        };
        Self::new(&frames, dynamics, inputs)
    }

    /// From frames.
    ///
    /// # Errors
    /// Where a frame has no velocity or angular velocity.
    pub fn new(
        frames: &[FlightFrame],
        dynamics: Dynamics<f64>,
        inputs: Inputs<f64>,
    ) -> Result<Self> {
        Ok(Self {
            times: frames.iter().map(|frame| frame.time).collect(),
            postures: frames.iter().map(|frame| frame.posture).collect(),
            measured: frames.iter().map(measured_motion).collect::<Result<_>>()?,
            dynamics,
            inputs,
        })
    }

    /// Length (s).
    pub fn duration(&self) -> f64 {
        let ends = self.times.first().zip(self.times.last());
        ends.map_or(0.0, |(first, last)| last - first)
    }

    /// Height of the first frame (m, inertial).
    pub fn start_height(&self) -> f64 {
        self.measured
            .first()
            .map_or(0.0, |motion| motion.position.components.z)
    }
}
