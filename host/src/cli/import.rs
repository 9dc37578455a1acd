//! `bodyflight import`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::mapping::Mapping;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::import::{FILES, Report, Request, import, sensors};

use super::outputs::Outputs;
use super::{several, terminal};

/// Convert another system's motion into a recording: joints (BVH, ASF/AMC, SMPL), points (C3D, TRC, Vicon Nexus), joint
/// angles or quaternions (OpenSim, OpenSense, CSV), workbooks of MVN, folders of Xsens sensors, and raw inertial sensors.
#[derive(clap::Args)]
#[command(
    after_help = "A mapping says where the axes of the file point and what its segments are called (docs/import.md). \
                  Look at first-frame.svg before you trust the result. Exit code 5: the flight is written, but it contradicts \
                  itself or is no fall.\n\n\
                  Example: bodyflight import jump.csv --mapping mapping.toml --subject athlete.toml --out jump"
)]
pub(super) struct Args {
    /// The file, possibly compressed (.gz, .xz), or a folder with a file for each sensor.
    file: PathBuf,
    /// The mapping; not needed for BVH with common joint names, ASF/AMC, AMASS, OpenSense and MVN.
    #[arg(long, value_name = "TOML")]
    mapping: Option<PathBuf>,
    /// A subject.toml; by default the default subject.
    #[arg(long, value_name = "TOML")]
    subject: Option<PathBuf>,
    /// Folder for flight.mvnx, subject.toml, flight.toml and first-frame.svg; created if absent.
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let subject = match &args.subject {
        Some(path) => Subject::read(path)?,
        None => Subject::default(),
    };
    args.outputs.check_in(&args.out, FILES)?;
    let raw = match &args.mapping {
        Some(path) => ImuMapping::read(path)?,
        None => None,
    };
    let bar = terminal::share_bar("importing");
    let mut progress = |share| terminal::set_share(&bar, share);
    let report = match &raw {
        Some(mapping) => sensors::import(
            &sensors::Request {
                path: &args.file,
                mapping,
                subject: &subject,
                has_subject: args.subject.is_some(),
                folder: &args.out,
            },
            &mut progress,
        ),
        None => of_motion(args, &subject, &mut progress),
    };
    bar.finish_and_clear();
    let report = report?;
    if json {
        terminal::print_json(&report)?;
    } else {
        terminal::print(&report.to_string());
    }
    several::verdict(report.doubt(), &args.file)
}

/// Imports anything but raw sensors.
fn of_motion(args: &Args, subject: &Subject, progress: &mut dyn FnMut(f64)) -> Result<Report> {
    let mapping = args.mapping.as_deref().map(Mapping::read).transpose()?;
    import(
        &Request {
            file: &args.file,
            mapping: mapping.as_ref(),
            subject,
            has_subject: args.subject.is_some(),
            folder: &args.out,
        },
        progress,
    )
}
