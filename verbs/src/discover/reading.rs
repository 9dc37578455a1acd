//! The flights of a search: a whole recording, or the parts of one in which nothing touches the body.

use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_discovery::input::flight::RecordedFlight;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_mvnx::recording::{FlightFrame, Options, Warning, faults};
use bodyflight_replay::flight::Flight;
use nalgebra::Vector3;

use crate::airborne::{self, Capture};

/// Dynamic pressure (Pa) below which the air takes about a fiftieth of the weight, less than a hundredth on average.
const AIRLESS: f64 = 30.0;
/// Faults that `airborne` names and no effect of the library explains. A tilt of a degree and a drift of the angular
/// momentum are remarks: late postures, for instance, make the angular momentum drift.
const REFUSED: [&str; 4] = ["rate", "step", "mounting", "recording"];

/// What the files of a flight give to the search.
pub(super) struct Reading {
    /// The recording, or its parts in the air.
    pub(super) tracks: Vec<RecordedFlight>,
    /// What is said about a recording that is trusted all the same.
    pub(super) remarks: Vec<Warning>,
    /// Its fall without air, if that is what it is.
    jump: Option<Capture>,
    /// All frames, if the recording is a fall from end to end.
    pub(super) whole: Option<Vec<FlightFrame>>,
}

impl Reading {
    /// Reads a flight together with its model. Of a recording that is partly on the ground, only the parts in the air are
    /// used.
    ///
    /// # Errors
    /// Returns an error if a file is unusable or has no velocities, or if the recording contradicts itself: an effect
    /// would be named for a fault of the recording.
    pub(super) fn of(flight: &Flight, options: Options) -> Result<Self> {
        let mut frames = flight.open(options)?;
        let all = frames.by_ref().collect::<Result<Vec<_>>>()?;
        let of_fall = frames.of_fall();
        let mut remarks = frames.warnings();
        let is_carried = faults(&of_fall).is_some();
        let jump = if is_carried {
            remarks.retain(|warning| !of_fall.contains(warning));
            Some(Capture::of(flight)?).filter(|capture| !capture.parts().is_empty())
        } else if is_airless(flight, &all) {
            Some(Capture::of(flight)?)
        } else {
            None
        };
        if is_carried && jump.is_none() {
            remarks.extend(of_fall);
        }
        if let Some(doubt) = faults(&remarks) {
            return Err(
                Problem::doubt(format!("nothing is fitted to this flight: {doubt}"))
                    .in_file(&flight.recording),
            );
        }
        let scale = frames.gyroscope_scale();
        if scale.is_some() {
            let said = "the search takes the scale of the gyroscope out of the angular velocities";
            remarks.push(Warning::new(0, said.to_owned()));
        }
        let first = all.first().ok_or_else(|| {
            Problem::bad_input("expected frames of type \"normal\"").in_file(&flight.recording)
        })?;
        let dynamics = flight.dynamics(first.pelvis.position.components.z);
        let track = |samples: &[FlightSample], dynamics: Dynamics<f64>| {
            let samples: Vec<FlightSample> = (samples.iter())
                .map(|sample| without_scale(sample, scale.unwrap_or([1.0; 3])))
                .collect();
            RecordedFlight::new(&samples, dynamics, |time| flight.inputs_at(time))
        };
        let tracks = match &jump {
            Some(capture) if is_carried => {
                let parts = capture.parts().iter();
                parts
                    .map(|part| track(&part.recorded.samples, dynamics))
                    .collect()
            }
            _ => {
                let samples = all.iter().map(FlightFrame::sample);
                vec![track(&samples.collect::<Result<Vec<_>>>()?, dynamics)]
            }
        };
        Ok(Self {
            tracks,
            remarks,
            jump,
            whole: (!is_carried).then_some(all),
        })
    }
}

/// A sample without the scale of its gyroscope about the axes of the body. No effect of the library is one, so another
/// would take its place.
fn without_scale(sample: &FlightSample, scale: [f64; 3]) -> FlightSample {
    let mut corrected = *sample;
    let rates = &mut corrected.motion.angular_velocity.components;
    rates.component_div_assign(&Vector3::from(scale));
    corrected
}

/// Whether the air hardly matters anywhere in a recording.
fn is_airless(flight: &Flight, frames: &[FlightFrame]) -> bool {
    let Some(first) = frames.first() else {
        return false;
    };
    let air = flight.dynamics(first.pelvis.position.components.z).air;
    frames.iter().all(|frame| {
        let pelvis = &frame.pelvis;
        let flow = pelvis
            .velocity
            .map(|velocity| velocity - air.velocity_at(&pelvis.position));
        let density = air.density.at(pelvis.position.components.z);
        flow.is_some_and(|flow| 0.5 * density * flow.norm().powi(2) < AIRLESS)
    })
}

/// What all flights say without the air. A fall shows the frame rate, and so does a set of jumps in which none does alone.
///
/// # Errors
/// Returns an error if a fault is named that no effect explains.
pub(super) fn judged(readings: &[(&Flight, Reading)]) -> Result<Vec<String>> {
    let jumps: Vec<&Capture> = readings
        .iter()
        .filter_map(|(_, reading)| reading.jump.as_ref())
        .collect();
    let mut remarks = Vec::new();
    for verdict in airborne::judged_by_rate(&jumps) {
        let (refused, told): (Vec<_>, Vec<_>) =
            (verdict.faults.into_iter()).partition(|fault| REFUSED.contains(&fault.kind));
        let words: Vec<String> = refused.into_iter().map(|fault| fault.message).collect();
        if !words.is_empty() {
            return Err(Problem::doubt(format!(
                "nothing is fitted to these jumps: {}",
                words.join("; ")
            ))
            .help("bodyflight airborne tells more about each of them"));
        }
        remarks.extend(told.into_iter().map(|fault| fault.message));
    }
    Ok(remarks)
}
