//! `bodyflight estimate`.

use std::fmt::Write;
use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::model_file::Effects;
use bodyflight::output::files::write_file;
use bodyflight::verbs::estimate::{Estimation, Filter, estimate};
use bodyflight_core::estimator::measurement::Quantity;
use bodyflight_core::estimator::preset::{PRESETS, Preset};

use super::simulate::{Precision, Reading, refuse_inputs};
use super::terminal;

/// Estimate muscle inputs and damping over time, and compare the reconstruction with and without them.
#[derive(clap::Args)]
#[command(after_help = presets_help())]
pub(super) struct Args {
    /// A flight.toml, or an MVNX file alone.
    flight: PathBuf,
    /// What is measured, which limbs act, bounds and noise.
    #[arg(long, default_value = "tracking")]
    preset: String,
    /// Which filter.
    #[arg(long, value_enum, default_value = "reduced")]
    filter: FilterName,
    /// Write coefficients, deviations and NIS over time as CSV; flight.toml takes it as `inputs`.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    /// Write coefficients and channels as SVG.
    #[arg(long, value_name = "SVG")]
    plot: Option<PathBuf>,
    /// Effects to extend the model by: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// Precision of filter and model.
    #[arg(long, value_enum, default_value = "double")]
    precision: Precision,
    #[command(flatten)]
    reading: Reading,
}

#[derive(clap::ValueEnum, Clone, Copy)]
pub(super) enum FilterName {
    /// The paper's: thirteen whole runs.
    Paper,
    /// The unit's: the same reconstruction at a fraction of the cost.
    Reduced,
}

impl FilterName {
    /// The filter of the library.
    pub(super) const fn filter(self) -> Filter {
        match self {
            Self::Paper => Filter::Paper,
            Self::Reduced => Filter::Reduced,
        }
    }
}

fn presets_help() -> String {
    let mut text = String::from("Presets, what they measure, and how late their estimates come:\n");
    for preset in &PRESETS {
        let measured: Vec<&str> = preset
            .measurement
            .quantities()
            .map(Quantity::name)
            .collect();
        let late = preset.time_step::<f64>() * preset.prediction_window as f64;
        let _ = writeln!(
            text,
            "  {:28} {}; {late:.2} s",
            preset.name,
            measured.join(" ")
        );
    }
    text + "\nExample: bodyflight estimate flight.toml --preset transitions-agile --plot est.svg"
}

/// The preset of that name.
pub(super) fn preset(name: &str) -> Result<&'static Preset> {
    Preset::from_name(name).ok_or_else(|| {
        let names: Vec<&str> = PRESETS.iter().map(|preset| preset.name).collect();
        Problem::bad_input(format!("unknown preset \"{name}\""))
            .help(format!("one of: {}", names.join(", ")))
    })
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let preset = preset(&args.preset)?;
    let mut flight = Flight::read(&args.flight)?;
    if let Some(model) = &args.model {
        flight.effects = Effects::read(model)?;
    }
    let outputs = [&args.out, &args.plot];
    refuse_inputs(outputs, &[&args.flight, &flight.recording])?;
    let filter = args.filter.filter();
    let spinner = terminal::spinner("estimating");
    let progress = |time: f64| spinner.set_message(format!("estimating, {time:.0} s"));
    let options = args.reading.options();
    let estimation = match args.precision {
        Precision::Single => estimate::<f32>(&flight, preset, filter, options, progress),
        Precision::Double => estimate::<f64>(&flight, preset, filter, options, progress),
    };
    spinner.finish_and_clear();
    let estimation = estimation?;
    if let Some(path) = &args.out {
        estimation.write_csv(path)?;
    }
    if let Some(path) = &args.plot {
        let title = format!("{}: preset {}", args.flight.display(), preset.name);
        write_file(path, estimation.svg(&title)?.as_bytes())?;
    }
    if json {
        return terminal::print_json(&estimation.report);
    }
    print_report(&estimation);
    for path in outputs.into_iter().flatten() {
        terminal::print(&format!("written: {}", path.display()));
    }
    Ok(())
}

fn print_report(estimation: &Estimation) {
    let report = &estimation.report;
    let columns = [
        ("RMS, estimated", report.rms),
        ("RMS, constant", report.rms_constant),
        ("amplitude", report.amplitude),
    ];
    terminal::print(&terminal::gap_table(&columns).to_string());
    terminal::print(&format!(
        "{} updates, mean NIS {:.1}; {:.1} s of flight in {:.3} s of filtering; estimates come {:.2} s late",
        report.updates, report.nis_mean, report.duration_s, report.seconds, report.delay_s
    ));
    let flags = report.flags;
    terminal::print(&format!(
        "updates with faults: posture {}, measurement {}, update {}, covariance {}, motion {}; inconsistent {}",
        flags.posture,
        flags.measurement,
        flags.update,
        flags.covariance,
        flags.motion,
        flags.inconsistent
    ));
}
