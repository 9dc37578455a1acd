//! A flight to be streamed to the emulated chip.

use bodyflight_core::link::{Configure, Sample, SegmentTable};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_laboratory::synthesize::{self, Request};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::flight as file;
use bodyflight_replay::subject::Subject;
use bodyflight_unit::stream::{configuration, sample_of};

use crate::Result;

/// A flight as samples, with the configuration that the unit needs.
#[derive(Debug, Clone)]
pub struct Flight {
    pub(crate) configure: Configure,
    pub(crate) table: SegmentTable,
    pub(crate) samples: Vec<Sample>,
}

impl Flight {
    /// Flies the bundled maneuver of this name with the paper's sensor noise, for a unit that runs `preset`.
    ///
    /// # Errors
    /// Returns an error if there is no such maneuver or preset.
    pub fn of(maneuver: &str, preset: &str) -> Result<Self> {
        let (flight, frames) = flown(maneuver)?;
        let failed = |problem| format!("{problem:?}");
        let first = frames.first().ok_or("the maneuver has no frames")?;
        let (configure, table) = configuration(&flight, first, preset, RATE).map_err(failed)?;
        Ok(Self {
            configure,
            table,
            samples: frames.iter().map(sample_of).collect(),
        })
    }
}

/// Frames of a maneuver in a second.
pub(crate) const RATE: f64 = 240.0;

/// Flies the bundled maneuver of this name with the paper's sensor noise.
pub(crate) fn flown(maneuver: &str) -> Result<(file::Flight, Vec<FlightFrame>)> {
    let maneuver =
        Maneuver::from_name(maneuver).ok_or_else(|| format!("no maneuver {maneuver}"))?;
    let subject = Subject::default();
    let mut flight = file::Flight::bare("flight.mvnx".as_ref());
    flight.subject = subject.clone();
    flight.muscles = maneuver.muscles;
    let request = Request::new(maneuver, &subject, 1);
    let frames = synthesize::flown(&request, &flight.dynamics(4000.0));
    Ok((flight, frames.map_err(|problem| format!("{problem:?}"))?))
}
