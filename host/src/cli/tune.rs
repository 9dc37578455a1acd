//! `bodyflight tune`.

use std::fmt::Write as _;
use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::write_file;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::CommonCoefficients;
use bodyflight_verbs::tune::{Report, Search, tune};

use super::arguments::{at_least_one, within};
use super::outputs::Outputs;
use super::{several, simulate, terminal};

/// Search for the aerodynamic coefficients that reconstruct flights best, and check them on other flights.
#[derive(clap::Args)]
#[command(
    after_help = "Example: bodyflight tune turn-1 turn-2 --hold-out turn-3 --draws 50 --out best.toml\n\n\
                  Ctrl-C ends the search and keeps the best so far. Exit code 5: a flight cannot be trusted or does not fly with \
                  its own coefficients, the best leaves more than the paper's accuracy, or is worse on a flight held out."
)]
pub(super) struct Args {
    /// Flights to tune on.
    #[arg(required = true)]
    flights: Vec<PathBuf>,
    /// Flights to check the result on, which the search does not use.
    #[arg(long, value_name = "FLIGHT")]
    hold_out: Vec<PathBuf>,
    /// Number of coefficient sets to try; more take longer and find better ones.
    #[arg(long, default_value_t = 200)]
    draws: usize,
    /// Standard deviation of the draws, as a share of the subject's coefficients; larger searches further away.
    #[arg(long, default_value_t = 0.3)]
    spread: f64,
    /// Seed of the draws; another seed tries other sets.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Tune separate coefficients for each segment, the same left and right: 42 more numbers, so hold a flight out.
    #[arg(long)]
    per_segment: bool,
    /// Write the best coefficients as a [coefficients] table for subject.toml.
    #[arg(long, value_name = "TOML")]
    out: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
    #[command(flatten)]
    reading: simulate::Reading,
}

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    // Smaller ones would call the guess the best.
    within("spread", args.spread, [0.001, 2.0], "")?;
    at_least_one("draws", args.draws as u64)?;
    let read = |paths: &[PathBuf]| -> Result<Vec<Flight>> {
        paths.iter().map(|path| Flight::read(path)).collect()
    };
    let (flights, held_out) = (read(&args.flights)?, read(&args.hold_out)?);
    args.outputs.check_as(args.out.as_deref(), "toml")?;
    let bar = terminal::bar(args.draws as u64, "draws");
    let search = Search {
        draws: args.draws,
        spread: args.spread,
        seed: args.seed,
        per_segment: args.per_segment,
    };
    let report = tune(&flights, &held_out, search, args.reading.options(), || {
        bar.inc(1)
    });
    bar.finish_and_clear();
    let report = report?;
    if let Some(path) = &args.out {
        write_file(path, coefficients_toml(&report).as_bytes())?;
    }
    if json {
        terminal::print_json(&report)?;
        return verdict(args, &report);
    }
    print_report(&report);
    for warning in &report.warnings {
        terminal::note(&format!("warning: {warning}"));
    }
    if report.interrupted {
        terminal::note(&format!(
            "interrupted: this is the best of the first {} of {} draws",
            report.draws, args.draws
        ));
    }
    if let Some(path) = &args.out {
        terminal::print(&format!("written: {}", path.display()));
    }
    verdict(args, &report)
}

fn verdict(args: &Args, report: &Report) -> Result<()> {
    let path = args.out.as_ref().or(args.hold_out.first());
    several::verdict(report.doubt(), path.unwrap_or(&args.flights[0]))
}

fn coefficients_toml(report: &Report) -> String {
    let best = &report.best;
    let [pitch, yaw, roll] = best.damp;
    let mut text = format!(
        "[coefficients]\ncl = {:.4}\ncd = {:.4}\ncm = {:.4}\ndamp = [{pitch:.4}, {yaw:.4}, {roll:.4}]\n",
        best.cl, best.cd, best.cm
    );
    for own in &report.segments {
        // Writing to a String cannot fail.
        let _ = write!(
            text,
            "\n[coefficients.segment.{}]\ncl = {:.4}\ncd = {:.4}\ncm = {:.4}\n",
            own.segment, own.cl, own.cd, own.cm
        );
    }
    text
}

fn print_segments(report: &Report) {
    if report.segments.is_empty() {
        return;
    }
    let mut table = terminal::table(&["segment", "cd", "cl", "cm"]);
    for own in &report.segments {
        let numbers = [own.cd, own.cl, own.cm].map(|value| format!("{value:.3}"));
        table.add_row(std::iter::once(own.segment.to_owned()).chain(numbers));
    }
    terminal::print(&table.to_string());
}

fn print_report(report: &Report) {
    let mut table = terminal::table(&["coefficient", "guess", "best"]);
    let rows = |c: &CommonCoefficients| [c.cd, c.cl, c.cm, c.damp[0], c.damp[1], c.damp[2]];
    let names = ["cd", "cl", "cm", "damp pitch", "damp yaw", "damp roll"];
    for ((name, guess), best) in names
        .iter()
        .zip(rows(&report.guess))
        .zip(rows(&report.best))
    {
        table.add_row([
            (*name).to_owned(),
            format!("{guess:.3}"),
            format!("{best:.3}"),
        ]);
    }
    terminal::print(&table.to_string());
    terminal::print(&format!(
        "gap relative to the paper's accuracy, on the flights used: {:.3} before, {:.3} after {} draws",
        report.score_before, report.score_after, report.draws
    ));
    print_segments(report);
    for flight in &report.held_out {
        terminal::print(&format!(
            "held out {}: {:.3} before, {:.3} after",
            flight.recording, flight.score_before, flight.score_after
        ));
        let columns = [
            ("RMS before", flight.rms_before),
            ("RMS after", flight.rms_after),
        ];
        terminal::print(&terminal::gap_table(&columns).to_string());
    }
    if report.held_out.is_empty() && !report.interrupted {
        terminal::print(
            "no flight was held out, so the improvement is unchecked (--hold-out FLIGHT)",
        );
    }
}
