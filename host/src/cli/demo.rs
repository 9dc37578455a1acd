//! `bodyflight demo`.

use std::path::PathBuf;

use bodyflight_core::maneuver::Maneuver;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use bodyflight_laboratory::synthesize::{Additions, FILES, Request};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::output::plot::comparison_svg;
use bodyflight_verbs::simulate::{RunFile, simulate};

use super::outputs::Outputs;
use super::terminal::FlightBar;
use super::{simulate as simulate_verb, synth, terminal};

/// Fly the bundled maneuver, write it as a recording, and reconstruct it: table, CSV and plot.
#[derive(clap::Args)]
#[command(after_help = "Example: bodyflight demo --out demo")]
pub(super) struct Args {
    /// Folder for all output files; created if absent.
    #[arg(long, default_value = "bodyflight-demo")]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
}

/// The bundled flight: a script in the core, bit-identical on every machine.
const MANEUVER: &str = "rotations";
const SEED: u64 = 1;

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let maneuver = Maneuver::from_name(MANEUVER)
        .ok_or_else(|| Problem::bad_input(format!("no maneuver {MANEUVER}")))?;
    let subject = Subject::default();
    let request = Request::new(maneuver, &subject, SEED);
    for names in [FILES, &["run.csv", "run.svg"]] {
        args.outputs.check_in(&args.out, names)?;
    }
    let written = synth::write(&request, Additions::default(), &args.out)?;
    let flight = Flight::read(&written.flight)?;
    let (csv, svg) = (args.out.join("run.csv"), args.out.join("run.svg"));
    let mut file = RunFile::create(&csv)?;
    let bar = FlightBar::new("simulating", &flight);
    let simulation = simulate(
        &flight,
        Options::default(),
        Precision::Double,
        &mut |step| file.write(step),
        &mut |time| bar.at(time),
    );
    bar.end();
    let simulation = simulation?;
    file.finish()?;
    let title = format!(
        "{}: {}, free run against measurement",
        maneuver.name, maneuver.summary
    );
    write_file(
        &svg,
        comparison_svg(&title, &simulation.comparison)?.as_bytes(),
    )?;
    if json {
        return terminal::print_json(&simulation.report);
    }
    terminal::print(&format!(
        "{}: {} (synthetic flight, sensor noise of the paper)",
        maneuver.name, maneuver.summary
    ));
    simulate_verb::print_report(&simulation);
    for path in [written.flight, csv, svg] {
        terminal::print(&format!("written: {}", path.display()));
    }
    Ok(())
}
