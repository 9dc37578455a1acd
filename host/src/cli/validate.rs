//! `bodyflight validate`.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_verbs::validate::captures::{Captures, LENGTH};
use bodyflight_verbs::validate::inputs::Inputs;
use bodyflight_verbs::validate::windows::{MODELS, Spread};
use bodyflight_verbs::validate::{Report, figure};

use super::outputs::{Outputs, Plot};
use super::terminal::{self, Stages};

/// Compare the model with real flights: parts of twisting somersaults predicted from their first frame, and falls
/// recorded by loggers.
#[derive(clap::Args)]
#[command(
    after_help = "Exit code 4: the exact equations are off by more than 5 degrees in 0.25 s or 12 in 0.5 s, the published \
    ones are less than five times worse, or a fall is not explained or predicted.\n\n\
                  Examples:\n  bodyflight validate --plot validation.svg\n  bodyflight validate turn-1 turn-2\n  bodyflight validate captures.toml"
)]
pub(super) struct Args {
    /// Your own flights without a canopy, instead of the two bundled with the program; loggers' tracks, or folders of
    /// them; tables of captures (docs/airborne.md).
    #[arg(value_name = "FLIGHT|TRACK|TABLE")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    plot: Plot,
    #[command(flatten)]
    outputs: Outputs,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let stages = Stages::new("validating");
    let inputs = Inputs::read(&args.paths)?;
    args.outputs.check_with([], &args.plot)?;
    let report = inputs.validate()?;
    let title = args.plot.title(|| "Whole flights, start fitted".to_owned());
    let drawn = args.plot.write(|| figure::svg(&title, &inputs.flights));
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

/// Prints the jumps of captures, a row for each source.
fn print_captures(captures: &Captures) {
    terminal::print(&format!(
        "Times in the air: attitude error after {LENGTH} s, start smoothed over 0.1 s, degrees: median (90th percentile)."
    ));
    let mut heads = vec!["source", "people", "phases", "windows", "g, m/s2"];
    heads.extend(MODELS.iter().map(|model| model.name));
    let mut table = terminal::table(&heads);
    for row in &captures.sources {
        let first = row.predictions.first();
        let gravity = row.g_mps2.zip(row.g_standard_error_mps2);
        let mut cells = vec![
            row.source.clone(),
            row.people.to_string(),
            row.phases.to_string(),
            first.map_or(0, |row| row.windows).to_string(),
            gravity.map_or(String::new(), |(g, error)| format!("{g:.2} +- {error:.2}")),
        ];
        cells.extend(MODELS.iter().map(|model| {
            let row = row.predictions.iter().find(|row| row.model == model.key);
            row.map_or(String::new(), |row| degrees(&row.smoothed))
        }));
        table.add_row(cells);
    }
    terminal::print(&table.to_string());
    for skipped in &captures.skipped {
        terminal::print(&format!(
            "skipped: {}, {}: {}",
            skipped.source,
            skipped.file.display(),
            skipped.reason
        ));
    }
    terminal::print(&format!("{} captures were skipped", captures.skipped.len()));
}

fn print(report: &Report) {
    if !(report.captures.sources.is_empty() && report.captures.skipped.is_empty()) {
        print_captures(&report.captures);
    }
    if report.flights.is_empty() && report.checks.is_empty() {
        return;
    }
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
