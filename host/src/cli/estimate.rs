//! `bodyflight estimate`.

mod report;

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::measurement::Quantity;
use bodyflight_core::estimator::motion::measurement::NAMES;
use bodyflight_core::estimator::preset::{PRESETS, Preset};
use bodyflight_estimation::Filter;
use bodyflight_estimation::motion::Method;
use bodyflight_estimation::report::Report;
use bodyflight_estimation::request::Request;
use bodyflight_io::diagnostic::{Kind, Problem, Result};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::model_file::Effects;
use bodyflight_replay::preset_file::{AUTO, SIGMA_POINTS, Tuning};
use bodyflight_verbs::estimate::svg;
use serde::Serialize;

use super::arguments::{Names, at_least_one, within};
use super::outputs::{Outputs, Plot};
use super::several::{each, output_of};
use super::simulate::{PrecisionName, Reading};
use super::terminal::{self, FlightBar};

/// Estimate muscle inputs and damping over time, and compare the reconstruction with and without them.
#[derive(clap::Args)]
#[command(after_help = HELP)]
pub(super) struct Args {
    /// flight.toml files, their folders, or MVNX files on their own; each flight is estimated separately.
    #[arg(required_unless_present = "presets", value_name = "FLIGHT")]
    flights: Vec<PathBuf>,
    /// A built-in preset or a preset.toml: which quantities are measured, and how the filter is tuned. "auto" measures
    /// everything that the recording contains, with the limbs and the damping of the flight; "sigma-points" is the same
    /// with derivatives over the spread of the state.
    #[arg(long, default_value = AUTO, value_parser = Names(presets), hide_possible_values = true)]
    preset: String,
    /// List the built-in presets.
    #[arg(long)]
    presets: bool,
    /// Filter forward in time as on the unit, or smooth the whole flight.
    #[arg(long, value_enum, default_value = "filter")]
    method: MethodName,
    /// Model inside the filter; by default the full one with "auto", the reduced one with other presets.
    #[arg(long, value_enum)]
    filter: Option<FilterName>,
    /// Standard deviation of the recorded joint angles from the true ones, per axis: a larger one trusts the postures
    /// less and widens the error bars. Estimated from the innovations if omitted.
    #[arg(long, value_name = "DEG")]
    joint_error_deg: Option<f32>,
    /// Samples from one estimate to the next, instead of the preset's: fewer give more frequent estimates.
    #[arg(long, value_name = "SAMPLES")]
    solution_window: Option<usize>,
    /// Samples from the start of a prediction to its measurement, instead of the preset's: more make estimates later.
    /// For presets over windows only.
    #[arg(long, value_name = "SAMPLES")]
    prediction_window: Option<usize>,
    /// Factor on the process noise Q of the preset: above 1, inputs follow changes faster and are noisier.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    process_noise: f32,
    /// Factor on the measurement noise R of the preset, as a variance: above 1, measurements count for less.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    measurement_noise: f32,
    /// Factor on the initial variances P0 of the preset: above 1, the first measurements count for more.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    start_variance: f32,
    /// Write coefficients, deviations and consistency over time as CSV; flight.toml takes it as `inputs`.
    #[arg(long, value_name = "CSV")]
    out: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    /// Effects to add to the model: a model.toml.
    #[arg(long, value_name = "TOML")]
    model: Option<PathBuf>,
    /// Floating-point precision of filter and model.
    #[arg(long, value_enum, default_value = "double")]
    precision: PrecisionName,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: Reading,
}

const HELP: &str = "\
Examples:
  bodyflight estimate flight.toml --method smooth --out found.csv --plot est.svg
  bodyflight estimate turn-1 turn-2 --out {}.csv   ({} is the name of the flight)

Exits with code 5 and says why if a channel is reconstructed worse than with constant coefficients, or if consistency
is lost for more than a second or doubtful for a quarter of the time. Files are written all the same.";

#[derive(clap::ValueEnum, Clone, Copy)]
pub(super) enum MethodName {
    /// Forward in time, as on the unit.
    Filter,
    /// Use later measurements for earlier inputs too: smaller error bars and no delay.
    Smooth,
}

impl MethodName {
    /// The method of the library.
    pub(super) const fn method(self) -> Method {
        match self {
            Self::Filter => Method::Filter,
            Self::Smooth => Method::Smooth,
        }
    }
}

#[derive(clap::ValueEnum, Clone, Copy)]
pub(super) enum FilterName {
    /// The full model at every sample; with the paper's presets, thirteen runs of it.
    Paper,
    /// As on the unit: the same reconstruction at a fraction of the cost.
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

/// Joint errors that `--joint-error-deg` takes (degrees).
const JOINT_ERRORS: [f64; 2] = [0.01, 45.0];

/// Names of the presets over windows.
pub(super) fn window_presets() -> Vec<&'static str> {
    PRESETS.iter().map(|preset| preset.name).collect()
}

/// Names of all presets.
pub(super) fn presets() -> Vec<&'static str> {
    let mut names = vec![AUTO, SIGMA_POINTS];
    names.extend(window_presets());
    names
}

/// A row of the list of presets.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Listed {
    name: &'static str,
    measures: Vec<&'static str>,
    limbs: &'static str,
    late_s: f64,
}

fn list_presets(json: bool) -> Result<()> {
    let motion = [AUTO, SIGMA_POINTS].map(|name| Listed {
        name,
        measures: NAMES.to_vec(),
        limbs: "those of the flight",
        late_s: 0.0,
    });
    let windows = PRESETS.iter().map(|preset| Listed {
        name: preset.name,
        measures: preset
            .measurement
            .quantities()
            .map(Quantity::name)
            .collect(),
        limbs: preset.muscles.name(),
        late_s: preset.time_step::<f64>() * preset.prediction_window as f64,
    });
    let listed: Vec<Listed> = motion.into_iter().chain(windows).collect();
    if json {
        return terminal::print_plain_json(&listed);
    }
    let mut table = terminal::table(&["preset", "limbs", "late", "measures"]).spare(&[2]);
    for row in &listed {
        table.add_row([
            row.name.to_owned(),
            row.limbs.to_owned(),
            format!("{:.2} s", row.late_s),
            if row.measures == NAMES {
                "everything that the recording has".to_owned()
            } else {
                row.measures.join(" ")
            },
        ]);
    }
    terminal::print(&table.to_string());
    Ok(())
}

/// Checks that a unit has a preset of this name.
pub(super) fn unit_preset(name: &str) -> Result<String> {
    if ![AUTO, SIGMA_POINTS].contains(&name) {
        preset(name)?;
    }
    Ok(name.to_owned())
}

/// Returns the paper's preset of that name, for verbs that support no others.
pub(super) fn preset(name: &str) -> Result<&'static Preset> {
    Preset::from_name(name)
        .ok_or_else(|| Problem::unknown("preset", name, PRESETS.iter().map(|preset| preset.name)))
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    if args.presets {
        return list_presets(json);
    }
    let request = Request {
        tuning: args.tuning()?,
        method: args.method.method(),
        filter: args.filter.map(FilterName::filter),
    };
    each(&args.flights, json, |path| {
        run_flight(path, args, &request, json)
    })
}

fn run_flight(
    path: &Path,
    args: &Args,
    request: &Request,
    json: bool,
) -> Result<(Report, Result<()>)> {
    let mut flight = Flight::read(path)?;
    if let Some(model) = &args.model {
        flight.effects = Effects::read(model)?;
        terminal::note_random(&flight.effects);
    }
    note_limbs(&request.tuning, &flight);
    let out = output_of(args.out.as_ref(), path, &args.flights)?;
    let plot = args.plot.of(path, &args.flights)?;
    args.outputs.check_with([&out], &plot)?;
    let bar = FlightBar::new("estimating", &flight);
    let options = args.reading.options();
    let precision = args.precision.into();
    let estimation = request.run(&flight, options, precision, &mut |time| bar.at(time));
    bar.end();
    let estimation = estimation.map_err(|problem| args.about_preset(problem))?;
    if let Some(path) = &out {
        estimation.write_csv(path)?;
    }
    let title = || format!("{}: preset {}", path.display(), args.preset);
    plot.write(|| svg(&estimation, &plot.title(title)))?;
    if matches!(args.method, MethodName::Smooth) && !estimation.report.is_smoothed {
        terminal::note(
            "these are the filter's estimates: the whole flight has no smoothed solution, since the errors of its joints change during it or its velocities are not those of a suit",
        );
    }
    if !json {
        report::print(&estimation);
        for path in [&out, &plot.path].into_iter().flatten() {
            terminal::print(&format!("written: {}", path.display()));
        }
        report::print_conclusion(&estimation, path, out.as_deref());
    }
    let verdict = match &estimation.report.doubt {
        None => Ok(()),
        Some(sentence) => Err(Problem::doubt(sentence.clone()).in_file(path).help(
            if estimation.report.is_recording_doubtful {
                "mend the recording or its files first: bodyflight inspect says what it contains"
            } else if estimation.report.assumed_velocity_sd_mps.is_some() {
                "give a receiver's track: gnss = \"TRACK.CSV\" in flight.toml, or in the table [flight] of the mapping of raw sensors; a recording of MVN can be exported with <velocity>"
            } else {
                advice(&request.tuning)
            },
        )),
    };
    Ok((estimation.report, verdict))
}

/// Notes if a preset over windows uses other limbs than the flight.
fn note_limbs(tuning: &Tuning, flight: &Flight) {
    let Tuning::Windows(preset) = tuning else {
        return;
    };
    if preset.muscles.name() != flight.muscles.name() {
        terminal::note(&format!(
            "preset {} uses the limbs {}, the flight says {}",
            preset.name,
            preset.muscles.name(),
            flight.muscles.name()
        ));
    }
}

/// What to try instead.
fn advice(tuning: &Tuning) -> &'static str {
    match tuning {
        Tuning::Windows(_) => {
            "--preset auto measures everything that the recording contains, and its error bars are realistic"
        }
        Tuning::Motion { .. } => {
            "the model lacks an effect: bodyflight discover names it, and --model adds what it found; \
             or the joints are worse than --joint-error-deg says"
        }
    }
}

impl Args {
    /// Names the file of the preset in a problem that no other file has.
    fn about_preset(&self, problem: Problem) -> Problem {
        let path = Path::new(&self.preset);
        if problem.kind == Kind::BadInput && path.is_file() {
            problem.in_file(path)
        } else {
            problem
        }
    }

    /// The preset, as changed by the flags.
    fn tuning(&self) -> Result<Tuning> {
        let mut tuning = Tuning::find(&self.preset)?;
        let refused = |flag: &str, kind: &str| {
            Err(Problem::bad_input(format!(
                "--{flag} is for {kind}, which preset \"{}\" does not use",
                self.preset
            )))
        };
        for factor in [
            self.process_noise,
            self.measurement_noise,
            self.start_variance,
        ] {
            if !(factor.is_finite() && factor > 0.0) {
                return Err(Problem::bad_input(format!(
                    "expected --process-noise, --measurement-noise and --start-variance above 0, found {factor}"
                )));
            }
        }
        for (option, window) in [
            ("solution-window", self.solution_window),
            ("prediction-window", self.prediction_window),
        ] {
            if let Some(window) = window {
                at_least_one(option, window as u64)?;
            }
        }
        if let Some(degrees) = self.joint_error_deg {
            within(
                "joint-error-deg",
                f64::from(degrees),
                JOINT_ERRORS,
                "degrees",
            )?;
        }
        match &mut tuning {
            Tuning::Motion {
                preset,
                joint_error_given,
                ..
            } => {
                if self.prediction_window.is_some() {
                    return refused("prediction-window", "filters over windows");
                }
                if let Some(degrees) = self.joint_error_deg {
                    preset.joint_error = degrees.to_radians();
                    *joint_error_given = true;
                }
                if let Some(window) = self.solution_window {
                    preset.solution_window = window;
                }
                preset.scale(
                    self.process_noise,
                    self.measurement_noise,
                    self.start_variance,
                );
            }
            Tuning::Windows(preset) => {
                if self.joint_error_deg.is_some() {
                    return refused("joint-error-deg", "the motion filter");
                }
                preset.solution_window = self.solution_window.unwrap_or(preset.solution_window);
                preset.prediction_window =
                    self.prediction_window.unwrap_or(preset.prediction_window);
                preset.scale(
                    self.process_noise,
                    self.measurement_noise,
                    self.start_variance,
                );
            }
        }
        Ok(tuning)
    }
}
