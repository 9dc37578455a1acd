//! `bodyflight synth`.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::DEFAULT_DENSITY;
use bodyflight::formats::subject::Subject;
use bodyflight::verbs::synthesize::{DEFAULT_SWAY, FILES, JointError, Report, Request, synthesize};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;

use super::outputs::Outputs;
use super::terminal;

/// Fly a maneuver with the model and write it like a recording, with sensor noise.
#[derive(clap::Args)]
#[command(after_help = maneuvers_help())]
pub(super) struct Args {
    /// Which maneuver.
    maneuver: String,
    /// A subject.toml; the default subject where absent.
    #[arg(long)]
    subject: Option<PathBuf>,
    /// Seed of sway and sensor noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for flight.toml, subject.toml, inputs.csv and flight.mvnx; made where absent.
    #[arg(long)]
    out: PathBuf,
    /// Air density (kg/m3).
    #[arg(long, default_value_t = DEFAULT_DENSITY)]
    density: f64,
    /// Sensor noise as a share of the paper's figures; 0 for perfect sensors.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// Deviation of the recorded joints from the true ones, each axis, constant over the flight.
    #[arg(long, default_value_t = 0.0, value_name = "DEG")]
    joint_error_deg: f64,
    /// The same, wandering at 0.08 to 0.5 Hz.
    #[arg(long, default_value_t = 0.0, value_name = "DEG")]
    joint_wander_deg: f64,
    #[command(flatten)]
    outputs: Outputs,
    /// Fly in a wind tunnel whose stream carries the neutral pose; tells when net, wall and top would be met.
    #[arg(long)]
    tunnel: bool,
}

fn maneuvers_help() -> String {
    let list = MANEUVERS
        .iter()
        .map(|m| format!("  {:14} {}\n", m.name, m.summary))
        .collect::<String>();
    format!("Maneuvers:\n{list}\nExample: bodyflight synth rotations --seed 1 --out rotations")
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let subject = match &args.subject {
        Some(path) => Subject::read(path)?,
        None => Subject::default(),
    };
    let maneuver = Maneuver::from_name(&args.maneuver).ok_or_else(|| {
        let known = MANEUVERS.iter().map(|maneuver| maneuver.name);
        Problem::unknown("maneuver", &args.maneuver, known)
    })?;
    let request = Request {
        maneuver,
        subject: &subject,
        density: args.density,
        seed: args.seed,
        noise: SensorNoise::PAPER.scaled(args.noise),
        joint_error: JointError {
            calibration: args.joint_error_deg.to_radians(),
            wander: args.joint_wander_deg.to_radians(),
        },
        sway: DEFAULT_SWAY,
        tunnel: args.tunnel,
    };
    request.check()?;
    args.outputs.check_in(&args.out, FILES)?;
    let report = write(&request, &args.out)?;
    if json {
        return terminal::print_json(&report);
    }
    terminal::print(&format!(
        "{} frames, {:.1} s: {}",
        report.frames,
        report.duration_s,
        report.flight.display()
    ));
    if let Some(tunnel) = report.tunnel {
        terminal::print(&format!("tunnel: {tunnel}"));
    }
    Ok(())
}

/// Writes a synthetic flight, with a bar.
pub(super) fn write(request: &Request<'_>, folder: &std::path::Path) -> Result<Report> {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "seconds of a script"
    )]
    let bar = terminal::bar(request.maneuver.duration as u64, "flying");
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "seconds of a script"
    )]
    let report = synthesize(request, folder, |time| bar.set_position(time as u64));
    bar.finish_and_clear();
    report
}
