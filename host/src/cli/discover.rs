//! `bodyflight discover`.

mod args;
mod output;
mod point;

use std::path::{Path, PathBuf};

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::flysight;
use bodyflight::interrupt;
use bodyflight::verbs::discover::{figure, model_toml, problem, read_track, refuse_same};
use bodyflight_discovery::check::Finding;
use bodyflight_discovery::progress::Progress;
use bodyflight_discovery::report::{CHANNEL_NAMES, Report};
use bodyflight_discovery::search::{Settings, discover};
use indicatif::ProgressBar;

use super::terminal;
pub(super) use args::Args;
use output::{print_gap, print_held_out, print_names, write_all};

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let fitted = Flight::read(&args.flight)?;
    for held_out in &args.hold_out {
        refuse_same(&fitted.recording, &Flight::read(held_out)?.recording)?;
    }
    if flysight::is_flysight(&fitted.recording) {
        return point::run(args, json);
    }
    terminal::note_assumed_subject(&fitted);
    let read = |path: &PathBuf| {
        let flight = Flight::read(path)?;
        if flysight::is_flysight(&flight.recording) {
            return Err(Problem::bad_input(
                "expected an MVNX recording, found that of a point (CSV)",
            )
            .in_file(&flight.recording)
            .help("flights that are held out must be of the kind that effects are fitted to"));
        }
        read_track(&flight, args.reading.options())
    };
    let track = read(&args.flight)?;
    let held_out = args.hold_out.iter().map(read).collect::<Result<Vec<_>>>()?;
    let settings = Settings {
        max_effects: args.max_effects,
        seed: args.seed,
    };
    let spinner = terminal::spinner("discovering");
    let report = discover(&track, &held_out, &settings, &Spinner(&spinner));
    spinner.finish_and_clear();
    let report = report.map_err(problem)?;
    if let Some(folder) = &args.out {
        write(&report, folder, &args.flight)?;
    }
    if json {
        return terminal::print_json(&report);
    }
    print_report(&report);
    if let Some(folder) = &args.out {
        terminal::print(&format!("written: {}", folder.display()));
    }
    Ok(())
}

/// Stages on the terminal; Ctrl-C ends the search.
struct Spinner<'a>(&'a ProgressBar);

impl Progress for Spinner<'_> {
    fn stage(&self, name: &str) {
        self.0.set_message(name.to_owned());
    }

    fn is_cancelled(&self) -> bool {
        interrupt::requested()
    }
}

fn write(report: &Report, folder: &Path, flight: &Path) -> Result<()> {
    let title = format!("{}: what the model misses", flight.display());
    let figure = figure::svg(&title, report)?;
    write_all(folder, report, &figure, &model_toml(&report.model))
}

fn print_report(report: &Report) {
    print_names(
        report.verdict,
        report.disagreement,
        &report.effects,
        &report.nearest,
    );
    for check in &report.checks {
        let what = match check.finding {
            Finding::Found => "found",
            Finding::Absent => "none",
            Finding::Undecided => "not to be told here",
        };
        let numbers: Vec<String> = check
            .parameters
            .iter()
            .zip(&check.standard_errors)
            .map(|((name, value), (_, error))| format!("{name} {value:.4} +- {error:.4}"))
            .collect();
        terminal::print(&format!(
            "sensors alone, {}: {what} ({})",
            check.name,
            numbers.join(", ")
        ));
    }
    let gap = &report.gap;
    print_gap(
        ["channel", "where nothing is missing"],
        &CHANNEL_NAMES,
        [&gap.before, &gap.after, &gap.floor],
    );
    for (index, gap) in report.held_out.iter().enumerate() {
        let misfits = [gap.misfit_before, gap.misfit_after, gap.misfit_expected];
        print_held_out("flight", index, misfits, gap.closed_share());
    }
}
