//! `bodyflight fall`.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::track;
use bodyflight::verbs::fall::beside::Beside;
use bodyflight::verbs::fall::{
    Conditions, DEFAULT_MASS, Moment, Report, WindRow, beside, fall, figure,
};
use bodyflight_falls::prediction::{Prediction, Trials};
use bodyflight_falls::verdict::Verdict;

use super::outputs::{Outputs, Plot};
use super::terminal;

/// Analyse a jump from a logger's track: exit, fall rate, drag area, wind, opening, canopy.
#[derive(clap::Args)]
#[command(
    after_help = "Tracks: FlySight 1 and 2 (SENSOR.CSV beside TRACK.CSV is used), GPX, or CSV with a header line; \
    see docs/falls.md. Exit code 4: the fall is not explained.\n\n\
                  Example: bodyflight fall TRACK.CSV --mass 85 --plot fall.svg"
)]
pub(super) struct Args {
    /// A logger's track; - is standard input.
    track: PathBuf,
    /// Mass of skydiver and equipment (kg); the drag area is proportional to it.
    #[arg(long, value_name = "KG", default_value_t = DEFAULT_MASS)]
    mass: f64,
    /// Air pressure on the ground (hPa), not reduced to sea level; by default from the logger's barometer or the
    /// standard atmosphere.
    #[arg(long, value_name = "HPA")]
    ground_pressure: Option<f64>,
    /// Temperature on the ground (degrees Celsius); by default that of the standard atmosphere.
    #[arg(long, value_name = "C", allow_negative_numbers = true)]
    ground_temperature: Option<f64>,
    /// Height in the standard atmosphere to which fall rates are normalised (m); a greater height gives faster rates.
    #[arg(long, value_name = "M", default_value_t = 2000.0)]
    reference_height: f64,
    /// Track of another jumper from the same aircraft load; the winds of both falls are compared.
    #[arg(long, value_name = "TRACK")]
    beside: Option<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let conditions = conditions(args)?;
    let spinner = terminal::spinner("reading");
    let track = track::read(&args.track)?;
    args.outputs.check_with([], &args.plot)?;
    let (mut report, jump) = fall(&track, &conditions, &args.track)?;
    if let Some(path) = &args.beside {
        report.beside = Some(beside(path, &conditions, &jump)?);
    }
    spinner.finish_and_clear();
    let title = || args.track.display().to_string();
    args.plot
        .write(|| figure::svg(&args.plot.title(title), &jump, conditions.mass))?;
    if json {
        terminal::print_json(&report)?;
    } else {
        print(&report);
    }
    if report.verdict == Verdict::Unexplained {
        return Err(Problem::disagreement(report.reason).in_file(&args.track));
    }
    if let (Some(beside), Some(path)) = (&report.beside, &args.beside)
        && !beside.agrees()
    {
        let apart = beside.winds_apart.unwrap_or(f64::NAN);
        return Err(Problem::disagreement(format!(
            "the winds of both falls are {apart:.1} deviations apart: they are not from one load, or one jumper steered"
        ))
        .in_file(path));
    }
    Ok(())
}

fn conditions(args: &Args) -> Result<Conditions> {
    let within = |name: &str, value: f64, [low, high]: [f64; 2]| {
        if (low..=high).contains(&value) {
            return Ok(value);
        }
        Err(Problem::bad_input(format!(
            "--{name}: expected {low} to {high}, found {value}"
        )))
    };
    let optional = |name: &str, value: Option<f64>, range: [f64; 2]| {
        value.map(|value| within(name, value, range)).transpose()
    };
    let pressure = optional("ground-pressure", args.ground_pressure, [500.0, 1100.0])?;
    let temperature = optional("ground-temperature", args.ground_temperature, [-60.0, 60.0])?;
    Ok(Conditions {
        mass: within("mass", args.mass, [30.0, 300.0])?,
        ground_pressure: pressure.map(|pressure| 100.0 * pressure),
        ground_temperature: temperature.map(|temperature| temperature + 273.15),
        reference_height: within(
            "reference-height",
            args.reference_height,
            [-500.0, 11_000.0],
        )?,
    })
}

fn moment(name: &str, moment: Option<&Moment>) {
    let Some(moment) = moment else {
        terminal::print(&format!("{name:<10}not on the track"));
        return;
    };
    terminal::print(&format!(
        "{name:<10}{:.1} s, {:.0} m",
        moment.time_s, moment.height_m
    ));
}

fn print(report: &Report) {
    moment("exit", report.exit.as_ref());
    moment("opening", report.opening.as_ref());
    moment("canopy", report.canopy.as_ref());
    moment("landing", report.landing.as_ref());
    terminal::print(&format!(
        "fall      {:.1} s, {:.1} m/s at most, {:.1} m/s normalised to {:.0} m of the standard atmosphere",
        report.fall_s, report.fastest_mps, report.normalised_rate_mps, report.reference_height_m
    ));
    terminal::print(&format!(
        "drag area {:.3} m2 at {:.0} kg, +- {:.3} from second to second; {:.0} kg/m2",
        report.drag_area_m2, report.mass_kg, report.drag_area_spread_m2, report.ballistic_kgpm2
    ));
    let glide =
        |glide: Option<f64>| glide.map_or("unknown".to_owned(), |glide| format!("{glide:.2}"));
    terminal::print(&format!(
        "glide     {} in the fall, {} under canopy over ground",
        glide(report.glide),
        glide(report.canopy_glide)
    ));
    if let Some(opening) = &report.opening_details {
        let sensed = report.sensors.largest_g.map_or(String::new(), |g| {
            format!(", {g:.1} g by the accelerometer")
        });
        terminal::print(&format!(
            "opened    in {:.1} s and {:.0} m, {:.1} g by the receiver{sensed}",
            opening.duration_s, opening.lost_m, opening.largest_g
        ));
    }
    let mut table = terminal::table(&["piece", "drag area m2", "lift area m2", "glide"]);
    for piece in &report.pieces {
        table.add_row([
            format!("{:.1} to {:.1} s", piece.from_s, piece.until_s),
            format!("{:.3} +- {:.3}", piece.drag_area_m2, piece.deviation_m2),
            format!("{:.3}", piece.lift_area_m2),
            format!("{:.2}", piece.glide),
        ]);
    }
    terminal::print(&table.to_string());
    print_winds(report);
    report.prediction.iter().for_each(print_prediction);
    report.beside.iter().for_each(print_beside);
    if report.rows_taken_out + report.rows_skipped > 0 {
        terminal::print(&format!(
            "{} rows are far from their neighbours and {} could not be read; none of them were used",
            report.rows_taken_out, report.rows_skipped
        ));
    }
    if !report.has_velocities {
        terminal::print(
            "the track has no velocities: they are differentiated from its positions, and noisier",
        );
    }
    let verdict = match report.verdict {
        Verdict::Explained => "explained",
        Verdict::Thin => "thin: too short to be judged",
        Verdict::Unexplained => "unexplained",
    };
    terminal::print(&format!("verdict: {verdict} ({})", report.reason));
}

fn print_beside(beside: &Beside) {
    let winds = match beside.winds_apart {
        Some(apart) => format!(
            "the winds of both falls are {apart:.1} deviations apart, at {} heights",
            beside.heights
        ),
        None => "the wind cannot be derived from one of the falls".to_owned(),
    };
    terminal::print(&format!(
        "beside    {:.1} m/s at the same height of the standard atmosphere; {winds}",
        beside.normalised_rate_mps
    ));
}

fn print_prediction(prediction: &Prediction) {
    terminal::print(&format!(
        "last third: {:.1} +- {:.1} m/s downwards predicted from the first two, {:.1} measured; {}",
        prediction.predicted_mps,
        prediction.deviation_mps,
        prediction.measured_mps,
        prediction.sentence
    ));
    let changed = match prediction.changes_before {
        0 => "never".to_owned(),
        1 => "once".to_owned(),
        times => format!("{times} times"),
    };
    let Trials {
        made,
        held,
        within_one,
        within_two,
    } = prediction.trials;
    terminal::print(&format!(
        "            the posture had changed {changed} before: a chance of {:.0} % that it stays. Of {made} earlier predictions \
         of this kind {held} held within 5 %, {within_one} within one deviation, {within_two} within two",
        100.0 * prediction.kept_chance
    ));
}

fn print_winds(report: &Report) {
    if report.wind.is_empty() {
        terminal::print("the wind cannot be derived from this fall, which glides or is too short");
    }
    if !report.wind.is_empty() || !report.canopy_wind.is_empty() {
        let mut table = terminal::table(&["wind at", "from", "m/s", "+- m/s", "source"]);
        let mut add = |row: &WindRow, by: &str| {
            table.add_row([
                format!("{:.0} m", row.height_m),
                format!("{:.0} deg", row.from_rad.to_degrees()),
                format!("{:.1}", row.speed_mps),
                format!("{:.1}", row.deviation_mps),
                by.to_owned(),
            ]);
        };
        report.wind.iter().for_each(|row| add(row, "the fall"));
        report
            .canopy_wind
            .iter()
            .for_each(|row| add(row, "circles under canopy"));
        terminal::print(&table.to_string());
    }
    if let Some(apart) = report.winds_apart {
        terminal::print(&format!(
            "winds of fall and canopy are {apart:.1} deviations apart"
        ));
    }
}
