//! `bodyflight figures`.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::verbs::figures::{FILES, Settings, write};
use serde::Serialize;

use super::outputs::Outputs;
use super::simulate::Reading;
use super::view::name_of;
use super::{estimate, terminal};

/// Draw the figures of a paper: reconstruction, inputs, way over ground and snapshots, as SVG.
#[derive(clap::Args)]
#[command(
    after_help = "Example: bodyflight figures flight.toml --preset turning --out figures\n\n\
                  Presets as in `bodyflight estimate --help`; those for turning show the yaw rate, others the horizontal velocity."
)]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file alone; 240 frames a second.
    flight: PathBuf,
    /// What is measured, which limbs act, bounds and noise.
    #[arg(long, default_value = "tracking")]
    preset: String,
    /// Which filter.
    #[arg(long, value_enum, default_value = "reduced")]
    filter: estimate::FilterName,
    /// Bodies in the row of snapshots.
    #[arg(long, default_value_t = 6)]
    snapshots: usize,
    /// Folder for the figures; made where absent.
    #[arg(long, value_name = "FOLDER", default_value = "figures")]
    out: PathBuf,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

#[derive(Serialize)]
struct Written {
    figures: Vec<PathBuf>,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    if !(1..=40).contains(&args.snapshots) {
        return Err(Problem::bad_input(format!(
            "expected --snapshots of 1 to 40, found {}",
            args.snapshots
        )));
    }
    let settings = Settings {
        preset: estimate::preset(&args.preset)?,
        filter: args.filter.filter(),
        snapshots: args.snapshots,
    };
    let flight = Flight::read(&args.flight)?;
    args.outputs.check_in(&args.out, FILES)?;
    let spinner = terminal::spinner("estimating");
    let progress = |time: f64| spinner.set_message(format!("drawing, {time:.0} s"));
    let title = name_of(&args.flight);
    let options = args.reading.options();
    let figures = write(&flight, &title, &settings, options, &args.out, progress);
    spinner.finish_and_clear();
    let figures = figures?;
    if json {
        return terminal::print_json(&Written { figures });
    }
    for path in figures {
        terminal::print(&format!("written: {}", path.display()));
    }
    Ok(())
}
