//! `bodyflight validate`.

use std::path::PathBuf;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::interrupt::Unfinished;
use bodyflight::replay::recorded::Recorded;
use bodyflight::verbs::validate::falls::{self, is_track};
use bodyflight::verbs::validate::windows::{MODELS, Spread};
use bodyflight::verbs::validate::{Report, bundled, figure, read, validate};

use super::outputs::{Outputs, Plot};
use super::terminal::{self, Stages};

/// Compare the model with real flights: parts of twisting somersaults predicted from their first frame, and falls
/// recorded by loggers.
#[derive(clap::Args)]
#[command(
    after_help = "Exit code 4: the exact equations are off by more than 5 degrees in 0.25 s or 12 in 0.5 s, the published \
    ones are less than five times worse, or a fall is not explained or predicted.\n\n\
                  Examples:\n  bodyflight validate --plot validation.svg\n  bodyflight validate turn-1 turn-2"
)]
pub(super) struct Args {
    /// Your own flights without a canopy, instead of the two bundled with the program; loggers' tracks, or folders of
    /// them.
    #[arg(value_name = "FLIGHT|TRACK")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let stages = Stages::new("validating");
    let folder = bundled::temporary()?;
    let _unfinished = Unfinished::new(folder.path());
    let of_loggers =
        |path: &&PathBuf| is_track(path) || path.is_dir() && !path.join("flight.toml").exists();
    let (tracks, mut paths): (Vec<&PathBuf>, Vec<&PathBuf>) =
        args.paths.iter().partition(of_loggers);
    let bundled_paths = if paths.is_empty() {
        bundled::write(folder.path())?
    } else {
        Vec::new()
    };
    paths.extend(&bundled_paths);
    let tracks = tracks
        .into_iter()
        .map(|path| falls::tracks(path))
        .collect::<Result<Vec<_>>>()?
        .concat();
    let flights = paths
        .iter()
        .map(|path| {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            Ok((name.into_owned(), read(path)?))
        })
        .collect::<Result<Vec<(String, Recorded)>>>()?;
    args.outputs.check_with([], &args.plot)?;
    let report = validate(&flights, &tracks)?;
    let title = args.plot.title(|| "Whole flights, start fitted".to_owned());
    let drawn = args.plot.write(|| figure::svg(&title, &flights));
    stages.end();
    drawn?;
    if json {
        terminal::print_json(&report)?;
    } else {
        print(&report);
    }
    match report.failure() {
        None => Ok(()),
        Some(failure) => Err(Problem::disagreement(failure)),
    }
}

fn degrees(spread: &Spread) -> String {
    format!(
        "{:.1} ({:.1})",
        spread.median_rad.to_degrees(),
        spread.nine_tenths_rad.to_degrees()
    )
}

fn print(report: &Report) {
    terminal::print(&format!(
        "Error angle at the end of a window, degrees: median (90th percentile). Flights: {}.",
        report.flights.join(", ")
    ));
    let name = |key: &str| {
        let model = MODELS.iter().find(|model| model.key == key);
        model.map_or(String::new(), |model| model.name.to_owned())
    };
    let mut table = terminal::table(&[
        "model",
        "window",
        "turned",
        "from the first frame",
        "start smoothed over 0.1 s",
        "start fitted to the window",
    ]);
    for row in &report.windows {
        table.add_row([
            name(row.model),
            format!("{} s, {} of them", row.length_s, row.windows),
            format!("{:.0}", row.turned_rad.to_degrees()),
            degrees(&row.first_frame),
            degrees(&row.smoothed),
            degrees(&row.fitted),
        ]);
    }
    terminal::print(&table.to_string());
    let mut table = terminal::table(&["model", "whole flight, start fitted: rms, degrees"]);
    for row in &report.whole {
        let each: Vec<String> = row
            .rms_rad
            .iter()
            .map(|rms| format!("{:.1}", rms.to_degrees()))
            .collect();
        table.add_row([name(row.model), each.join(", ")]);
    }
    terminal::print(&table.to_string());
    for why in &report.not_judged {
        terminal::print(&format!("not judged: {why}"));
    }
    let mut table = terminal::table(&["data", "what", "expected", "found", "holds"]);
    for check in &report.checks {
        table.add_row([
            check.data.as_str(),
            &check.what,
            &check.expected,
            &check.found,
            if check.holds { "yes" } else { "no" },
        ]);
    }
    terminal::print(&table.to_string());
}
