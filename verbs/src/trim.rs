//! `bodyflight trim`: the steady belly-to-earth fall of a subject in the neutral pose.

use std::path::Path;

use bodyflight_core::Body;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::trim::{TrimError, trim as balance};
use serde::Serialize;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::{DensityChoice, Flight};
use bodyflight_replay::subject::Subject;
use bodyflight_replay::{conditions, person};

/// A steady fall.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// Speed of the fall (m/s).
    pub terminal_speed_mps: f64,
    /// Rotation about the left axis from standing (deg); 90 is belly to earth.
    pub body_pitch_deg: f64,
    /// Bend of the knees (deg).
    pub knee_deg: f64,
    /// Moment per rotation in pitch (N m/rad); negative is stable.
    pub pitch_stiffness_nm_per_rad: f64,
    /// Mass with equipment (kg).
    pub mass_kg: f64,
    /// Why this is no fall of a person.
    pub doubt: Option<String>,
}

/// Speeds of steady belly-to-earth falls, from a tunnel's child to a heavy person in thin air (m/s).
const SPEEDS: core::ops::RangeInclusive<f64> = 30.0..=90.0;

/// Why a steady fall is not that of a person.
fn doubt(subject: &Subject, body: &Body<f64>, speed: f64, stiffness: f64) -> Option<String> {
    let person = person::unlikely(body).or_else(|| conditions::coefficients(subject));
    person.or_else(|| {
        (!SPEEDS.contains(&speed)).then(|| {
            format!(
                "a steady fall at {speed:.1} m/s is not that of a person, expected {} to {} m/s: mass, areas or density are wrong",
                SPEEDS.start(),
                SPEEDS.end()
            )
        })
    })
    .or_else(|| {
        (stiffness > 0.0)
            .then(|| "this fall is unstable in pitch: no body stays in it without moving".to_owned())
    })
}

/// Finds the equilibrium of the neutral pose in still air of this density (kg/m3).
///
/// # Errors
/// Returns an error if the density is out of range or no bend of the knees gives equilibrium.
pub fn trim(subject: &Subject, density: f64) -> Result<Report> {
    if !(density > 0.0 && density <= 2.0) {
        return Err(Problem::bad_input(format!(
            "expected a density above 0 and up to 2 kg/m3, found {density}"
        )));
    }
    let mut flight = Flight::bare(Path::new(""));
    flight.subject = subject.clone();
    flight.density = DensityChoice::Constant(density);
    let dynamics = flight.dynamics(0.0);
    let trim = balance(&dynamics, &pattern::neutral(), 0.0).map_err(|error| match error {
        TrimError::NoBalance => Problem::disagreement(
            "no bend of the knees balances the neutral pose of this subject",
        )
        .help("most bodies balance if each moment arm is the width of its segment: moment_arm = \"width\""),
        TrimError::NoSupport => Problem::disagreement("the air cannot carry this subject at any speed"),
    })?;
    Ok(Report {
        terminal_speed_mps: trim.terminal_speed,
        body_pitch_deg: trim.body_pitch.to_degrees(),
        knee_deg: trim.knee.to_degrees(),
        pitch_stiffness_nm_per_rad: trim.pitch_stiffness,
        mass_kg: dynamics.body.mass(),
        doubt: doubt(
            subject,
            &dynamics.body,
            trim.terminal_speed,
            trim.pitch_stiffness,
        ),
    })
}
