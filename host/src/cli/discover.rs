//! `bodyflight discover`.

mod point;

use std::path::{Path, PathBuf};

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::flysight;
use bodyflight::interrupt;
use bodyflight::output::files::write_file;
use bodyflight::verbs::discover::{figure, model_toml, problem, read_track};
use bodyflight_discovery::check::Finding;
use bodyflight_discovery::progress::Progress;
use bodyflight_discovery::report::{CHANNEL_NAMES, Named, Outcome, Report};
use bodyflight_discovery::search::{Settings, discover};
use indicatif::ProgressBar;
use serde::Serialize;

use super::simulate::Reading;
use super::terminal;

/// Find where simulation and measurement disagree, name the effect that is missing, and show how the gap shrinks.
#[derive(clap::Args)]
#[command(
    after_help = "Verdicts: named, none (model and data agree to the noise), unexplained (a disagreement like nothing in \
                  the library), thin (too short to tell). docs/discovery.md says how often each is right.\n\n\
                  Example: bodyflight hide wind --out lab && bodyflight discover lab/flight-0/flight.toml \
                  --hold-out lab/flight-1/flight.toml --out found"
)]
pub(super) struct Args {
    /// A flight.toml, an MVNX file alone, or a FlySight's CSV file, of which density, wind and drag area are judged.
    flight: PathBuf,
    /// Other flights, which effects are not fitted to but have to help in.
    #[arg(long, value_name = "FLIGHT", num_args = 1..)]
    hold_out: Vec<PathBuf>,
    /// Most effects that are named.
    #[arg(long, default_value_t = 3)]
    max_effects: usize,
    /// Seed of the flights that are drawn for comparison.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for report.json, report.svg and model.toml; made where absent.
    #[arg(long)]
    out: Option<PathBuf>,
    #[command(flatten)]
    reading: Reading,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    if flysight::is_flysight(&Flight::read(&args.flight)?.recording) {
        return point::run(args, json);
    }
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

/// Writes report.json, report.svg and model.toml.
fn write_all(folder: &Path, report: &impl Serialize, figure: &str, model: &str) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, &error))?;
    let text = serde_json::to_string_pretty(report)
        .map_err(|error| Problem::bad_input(format!("cannot write JSON: {error}")))?;
    write_file(&folder.join("report.json"), text.as_bytes())?;
    write_file(&folder.join("report.svg"), figure.as_bytes())?;
    write_file(&folder.join("model.toml"), model.as_bytes())
}

/// Verdict and names, which recordings of all kinds have.
fn print_names(outcome: Outcome, disagreement: f64, effects: &[Named], nearest: &[Named]) {
    let verdict = match outcome {
        Outcome::Named => "named",
        Outcome::None => "none: model and data agree to the noise",
        Outcome::Unexplained => "unexplained: a disagreement like nothing in the library",
        Outcome::Thin => "thin: not enough excitation to tell effects apart",
    };
    terminal::print(&format!(
        "verdict: {verdict} (misfit {disagreement:+.1} deviations from that of flights in which nothing is missing)"
    ));
    if !nearest.is_empty() {
        terminal::print("came nearest, not used:");
    }
    for named in effects.iter().chain(nearest) {
        let parameters: Vec<String> = named
            .parameters
            .iter()
            .zip(&named.standard_errors)
            .map(|((name, value), (_, error))| format!("{name} = {value:.3} +- {error:.3}"))
            .collect();
        let stability = named.evidence.stability.map_or_else(String::new, |share| {
            format!(", first in {:.0} % of resampled flights", 100.0 * share)
        });
        terminal::print(&format!(
            "  {}: {} ({:.1} deviations beyond chance{})",
            named.name,
            parameters.join(", "),
            named.evidence.deviations,
            stability
        ));
        if !named.rivals.is_empty() {
            let rivals: Vec<&str> = named.rivals.iter().map(|rival| rival.name).collect();
            terminal::print(&format!(
                "    not to be told from {} here; fly: {}",
                rivals.join(", "),
                named.separated_by
            ));
        }
        if named.at_limit {
            terminal::print("    at the end of its plausible range: it is not all that is missing");
        }
        if named.imitated_by_inputs {
            terminal::print("    an estimator of muscle input and damping would take it for those");
        }
    }
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

/// Each channel before and after, and its floor; `titles` of the first and the last column.
fn print_gap(titles: [&str; 2], channels: &[&str], gap: [&[f64]; 3]) {
    let mut table = terminal::table(&[titles[0], "before", "after", titles[1]]);
    for (channel, name) in channels.iter().enumerate() {
        let numbers = gap.map(|values| format!("{:.3}", values[channel]));
        table.add_row([&[(*name).to_owned()][..], &numbers].concat());
    }
    terminal::print(&table.to_string());
}

/// Misfits of a recording held out: before, after, and where nothing is missing.
fn print_held_out(what: &str, index: usize, [before, after, expected]: [f64; 3], closed: f64) {
    terminal::print(&format!(
        "held-out {what} {}: misfit {before:.0} -> {after:.0}, {expected:.0} where nothing is missing; {:.0} % of \
         the gap closed",
        index + 1,
        100.0 * closed
    ));
}
