//! The checks of a flight on frames that arrive one by one, of which no file is read.

use bodyflight_mvnx::recording::{Checks, FlightFrame, Warning};

use crate::flight::Flight;
use crate::support::Support;

/// What is implausible in a flight while it is received.
#[derive(Debug, Clone)]
pub struct LiveChecks {
    checks: Checks,
    support: Support,
}

impl LiveChecks {
    /// For frames at this rate (Hz), in the air of a flight.
    pub fn new(flight: &Flight, frame_rate: f64) -> Self {
        Self {
            checks: Checks::new(frame_rate).in_air(flight.air_velocity),
            support: Support::in_air(flight.air_velocity),
        }
    }

    /// Takes the next frame.
    pub fn see(&mut self, frame: &FlightFrame) {
        self.checks.see(frame);
        self.support.see(frame);
    }

    /// Whatever is implausible so far: what the frames say against each other, and a body that does not fall.
    pub fn warnings(&self) -> Vec<Warning> {
        let mut warnings = self.checks.warnings();
        warnings.extend(self.support.warnings());
        warnings
    }
}
