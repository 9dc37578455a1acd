//! `bodyflight trim`.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::{DEFAULT_DENSITY, DensityChoice, Flight};
use bodyflight::formats::subject::Subject;
use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::trim::{TrimError, trim};
use serde::Serialize;

use super::terminal;

/// Find the steady belly-to-earth fall of a subject in the neutral pose: speed, pitch and bend of the knees.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight trim subject.toml --density 0.9")]
pub(super) struct Args {
    /// A subject.toml; the default subject where absent.
    subject: Option<PathBuf>,
    /// Air density (kg/m3).
    #[arg(long, default_value_t = DEFAULT_DENSITY)]
    density: f64,
}

#[derive(Serialize)]
struct Report {
    terminal_speed_mps: f64,
    body_pitch_deg: f64,
    knee_deg: f64,
    pitch_stiffness_nm_per_rad: f64,
    mass_kg: f64,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let mut flight = Flight::bare(std::path::Path::new(""));
    if let Some(path) = &args.subject {
        flight.subject = Subject::read(path)?;
    }
    if !(args.density > 0.0 && args.density <= 2.0) {
        return Err(Problem::bad_input(format!(
            "expected a density above 0 and up to 2 kg/m3, found {}",
            args.density
        )));
    }
    flight.density = DensityChoice::Constant(args.density);
    let dynamics = flight.dynamics(0.0);
    let trim = trim(&dynamics, &pattern::neutral(), 0.0).map_err(|error| match error {
        TrimError::NoBalance => Problem::disagreement(
            "no bend of the knees balances the neutral pose of this subject",
        )
        .help("moment arms of the segments' width give a balance for most bodies: moment_arm = \"width\""),
        TrimError::NoSupport => Problem::disagreement("the air does not carry this subject"),
    })?;
    let report = Report {
        terminal_speed_mps: trim.terminal_speed,
        body_pitch_deg: trim.body_pitch.to_degrees(),
        knee_deg: trim.knee.to_degrees(),
        pitch_stiffness_nm_per_rad: trim.pitch_stiffness,
        mass_kg: dynamics.body.mass(),
    };
    if json {
        return terminal::print_json(&report);
    }
    let mut table = terminal::table(&["steady fall in the neutral pose", ""]);
    for (name, value) in [
        ("mass with equipment", format!("{:.1} kg", report.mass_kg)),
        (
            "terminal speed",
            format!("{:.1} m/s", report.terminal_speed_mps),
        ),
        (
            "body pitch (90: belly to earth)",
            format!("{:.1} deg", report.body_pitch_deg),
        ),
        ("bend of the knees", format!("{:.1} deg", report.knee_deg)),
        (
            "pitch stiffness (negative: stable)",
            format!("{:.0} N m/rad", report.pitch_stiffness_nm_per_rad),
        ),
    ] {
        table.add_row([name, &value]);
    }
    terminal::print(&table.to_string());
    Ok(())
}
