//! `bodyflight trim`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::trim::trim;

use super::terminal;

/// Find the steady belly-to-earth fall of a subject in the neutral pose: speed, pitch and bend of the knees.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight trim subject.toml --density 0.9\n\n\
                  Exit code 4: nothing balances; 5: what balances is no fall of a person, or unstable in pitch.")]
pub(super) struct Args {
    /// A subject.toml; by default the default subject.
    subject: Option<PathBuf>,
    /// Air density (kg/m3); thinner air makes the fall faster.
    #[arg(long, default_value_t = DEFAULT_DENSITY)]
    density: f64,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let subject = match &args.subject {
        Some(path) => Subject::read(path)?,
        None => Subject::default(),
    };
    let report = trim(&subject, args.density)?;
    let verdict = match &report.doubt {
        None => Ok(()),
        Some(doubt) => Err(match &args.subject {
            Some(path) => Problem::doubt(doubt.clone()).in_file(path),
            None => Problem::doubt(doubt.clone()),
        }),
    };
    if json {
        terminal::print_json(&report)?;
        return verdict;
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
    verdict
}
