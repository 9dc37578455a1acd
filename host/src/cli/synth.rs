//! `bodyflight synth`.

use std::path::{Path, PathBuf};

use bodyflight_core::dynamics::muscle_input::MuscleForces;
use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::maneuver::scripts::MANEUVERS;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::suit::placement::{SETS, of_size};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_laboratory::limb_sensors::{Fault, Limbs};
use bodyflight_laboratory::sensor_bytes::SensorBytes;
use bodyflight_laboratory::synthesize::{
    Additions, FILES, JointError, Report, Request, synthesize_with,
};
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject::Subject;

use super::arguments::Names;
use super::outputs::Outputs;
use super::terminal;

/// Simulate a maneuver and write it as a recording with sensor noise.
#[derive(clap::Args)]
#[command(after_help = maneuvers_help())]
pub(super) struct Args {
    /// Name of the maneuver.
    #[arg(value_parser = Names(|| MANEUVERS.iter().map(|maneuver| maneuver.name).collect()), hide_possible_values = true)]
    maneuver: String,
    /// A subject.toml; by default the default subject.
    #[arg(long)]
    subject: Option<PathBuf>,
    /// Seed of sway and sensor noise; another seed gives another flight of the same maneuver.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Folder for flight.toml, subject.toml, inputs.csv and flight.mvnx; created if absent.
    #[arg(long)]
    out: PathBuf,
    /// Air density (kg/m3); thinner air makes the fall faster.
    #[arg(long, default_value_t = DEFAULT_DENSITY)]
    density: f64,
    /// Factor on the sensor noise given in the paper; 0 for perfect sensors.
    #[arg(long, default_value_t = 1.0)]
    noise: f64,
    /// Standard deviation of the recorded joint angles from the true ones, per axis, constant over the flight.
    #[arg(long, default_value_t = 0.0, value_name = "DEG")]
    joint_error_deg: f64,
    /// The same for errors that wander at 0.08 to 0.5 Hz.
    #[arg(long, default_value_t = 0.0, value_name = "DEG")]
    joint_wander_deg: f64,
    /// What muscle input causes besides its moments: nothing, or the forces of the paper's equation (eq1_1).
    #[arg(long, value_enum, value_name = "FORCES", default_value_t = ForcesName::Moment)]
    muscle_forces: ForcesName,
    /// Lever arms l1 to l4 of the paper's forces, as shares of the stature, instead of those of a body: longer ones make
    /// the forces smaller.
    #[arg(long, value_name = "L1,L2,L3,L4", value_delimiter = ',')]
    lever_arms: Vec<f32>,
    #[command(flatten)]
    outputs: Outputs,
    /// Fly in a wind tunnel whose airflow carries the neutral pose; reports when the body would touch net, wall or top.
    #[arg(long)]
    tunnel: bool,
    /// Also write imu.bin: the bytes that an MTi at the pelvis and a receiver on its line would have sent, for
    /// `stream --sensor`.
    #[arg(long)]
    imu: bool,
    /// Also write the readings of raw inertial sensors on this many segments, from their calibration on the ground to the
    /// end of the flight, into the folder sensors, with a mapping for `import`.
    #[arg(long, value_name = "COUNT", value_parser = sensor_count)]
    sensors: Option<usize>,
    /// Also write chain.bin: the same readings as the bytes of these sensors on one line, with a receiver's solutions, for
    /// `stream --sensor --protocol chain`.
    #[arg(long, requires = "sensors")]
    chain: bool,
    /// A fault of one of these sensors: exchanged=SEGMENT, reversed, slipped, dead, saturated, late or mirrored, with a
    /// number if another than the usual one is wanted, as in l_shank:late=0.06.
    #[arg(long, value_name = "SEGMENT:FAULT", requires = "sensors")]
    sensor_fault: Option<String>,
}

/// A number of sensors for which there is a set.
fn sensor_count(text: &str) -> core::result::Result<usize, String> {
    let count = text.parse().ok();
    count
        .filter(|count| of_size(*count).is_some())
        .ok_or_else(|| {
            let sizes = SETS.map(|set| set.len().to_string());
            format!("expected one of {}", sizes.join(", "))
        })
}

/// Effects of muscle input by name, as in a flight.toml.
#[derive(clap::ValueEnum, Clone, Copy)]
enum ForcesName {
    /// Nothing.
    Moment,
    /// The moments divided by lever arms.
    Paper,
}

impl ForcesName {
    const fn forces(self) -> MuscleForces {
        match self {
            Self::Moment => MuscleForces::Moment,
            Self::Paper => MuscleForces::Paper,
        }
    }
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
        density: args.density,
        noise: SensorNoise::PAPER.scaled(args.noise),
        joint_error: JointError {
            calibration: args.joint_error_deg.to_radians(),
            wander: args.joint_wander_deg.to_radians(),
        },
        tunnel: args.tunnel,
        ..Request::new(maneuver, &subject, args.seed)
    };
    request.check()?;
    let fault = args.sensor_fault.as_deref().map(Fault::parse).transpose()?;
    let limbs = (args.sensors.and_then(of_size)).map(|segments| Limbs { segments, fault });
    if let Some(limbs) = &limbs {
        limbs.check()?;
    }
    args.outputs.check_in(&args.out, FILES)?;
    let sensor = args.imu.then_some(SensorBytes {
        seed: args.seed,
        ..SensorBytes::TYPICAL
    });
    let additions = Additions {
        sensor: sensor.as_ref(),
        muscle_forces: args.muscle_forces.forces(),
        lever_arms: lever_arms(args)?,
        limbs,
        chain: args.chain,
    };
    let report = write(&request, additions, &args.out)?;
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

/// The lever arms, if any are given.
fn lever_arms(args: &Args) -> Result<Option<[f32; 4]>> {
    if args.lever_arms.is_empty() {
        return Ok(None);
    }
    if matches!(args.muscle_forces, ForcesName::Moment) {
        return Err(Problem::bad_input(
            "--lever-arms needs --muscle-forces paper: moments alone have no lever arms",
        ));
    }
    let arms = <[f32; 4]>::try_from(args.lever_arms.as_slice()).ok();
    arms.filter(|arms| arms.iter().all(|arm| (0.01..=1000.0).contains(arm)))
        .map(Some)
        .ok_or_else(|| {
            Problem::bad_input(format!(
                "expected --lever-arms with four shares of the stature from 0.01 to 1000, found {:?}",
                args.lever_arms
            ))
        })
}

/// Writes a synthetic flight, and shows a progress bar.
pub(super) fn write(
    request: &Request<'_>,
    additions: Additions<'_>,
    folder: &Path,
) -> Result<Report> {
    let bar = terminal::share_bar("flying");
    let report = synthesize_with(request, additions, folder, &mut |time| {
        terminal::set_share(&bar, time / request.maneuver.duration);
    });
    bar.finish_and_clear();
    report
}
