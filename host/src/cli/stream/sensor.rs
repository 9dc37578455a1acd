//! `bodyflight stream --sensor`: the unit on this machine with nothing but its sensor's bytes.

use std::path::Path;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_unit::log;
use bodyflight_unit::monitor::Input;
use bodyflight_unit::sensor_line::{self, SensorReport};

use super::super::outputs::Outputs;
use super::super::terminal;
use super::super::unit::sensor::SensorArgs;

/// What to run on a sensor's bytes.
pub(super) struct Alone<'a> {
    /// A flight.toml or a subject.toml.
    pub(super) flight: &'a Path,
    pub(super) preset: &'a str,
    pub(super) sensor: &'a SensorArgs,
    /// Sample rate of the sensor (Hz).
    pub(super) rate: f64,
    /// A file, a port at `baud`, or - for standard input.
    pub(super) source: &'a str,
    pub(super) baud: u32,
    /// Folder for what a log would hold.
    pub(super) log: Option<&'a Path>,
    pub(super) outputs: Outputs,
}

pub(super) fn run(alone: &Alone<'_>, json: bool) -> Result<()> {
    let (setup, of_person) = alone.sensor.setup(alone.flight, alone.preset, alone.rate)?;
    let source = alone.source;
    let input = Input::open(source, alone.baud)?;
    if let Some(folder) = alone.log {
        alone.outputs.check_in(folder, &log::FILES)?;
    }
    let spinner = terminal::spinner("samples");
    let found = sensor_line::run(&setup, &input, |samples| {
        spinner.set_position(u64::from(samples));
    });
    spinner.finish_and_clear();
    let (flight, mut report) = found.map_err(|problem| problem.in_file(Path::new(source)))?;
    let doubts: Vec<String> = of_person.into_iter().chain(report.doubt).collect();
    report.doubt = (!doubts.is_empty()).then(|| doubts.join("; "));
    if let Some(folder) = alone.log {
        report.written = Some(log::write(&flight, None, folder)?);
    }
    if json {
        terminal::print_json(&report)?;
    } else {
        print(&report);
    }
    match report.doubt {
        None => Ok(()),
        Some(sentence) => Err(Problem::doubt(sentence)
            .in_file(Path::new(source))
            .help("the files hold all estimates with their flags, see docs/link.md, ESTIMATE")),
    }
}

fn print(report: &SensorReport) {
    terminal::print(&format!(
        "{:.1} s of a sensor, {} bytes: {} samples used, {} rejected, {} missing; {} restarts of the sensor, {} solutions \
         of a receiver",
        report.flight_s,
        report.bytes,
        report.used,
        report.rejected,
        report.missing,
        report.sensor_restarts,
        report.receiver_solutions
    ));
    let percent = |share: f64| 100.0 * share;
    terminal::print(&format!(
        "{} estimates, {:.0} % of them not in flight; in flight consistent {:.0} %, doubtful {:.0} %, lost {:.0} %",
        report.estimates,
        percent(report.supported),
        percent(report.consistent),
        percent(report.doubtful),
        percent(report.lost)
    ));
    if let Some(limbs) = &report.limbs {
        let lost: u32 = limbs.missing.iter().sum();
        terminal::print(&format!(
            "{} calibrated sensors on the limbs, {lost} packets missing; posture within {:.1} degrees at the end",
            limbs.calibrated.len(),
            limbs.deviations_deg.iter().copied().fold(0.0, f32::max)
        ));
    }
    let last = report.last.filter(|_| report.doubt.is_none());
    if let Some([north, west, up]) = last.and_then(|last| last.velocity_mps) {
        terminal::print(&format!(
            "last velocity: {north:.1} m/s north, {west:.1} west, {up:.1} up"
        ));
    }
    if let Some(written) = &report.written {
        terminal::print(&format!(
            "written: {} ({} frames, {} estimates)",
            written.flight.display(),
            written.frames,
            written.estimates
        ));
        if let Some(said) = written.without_posture() {
            terminal::note(&said);
        }
    }
}
