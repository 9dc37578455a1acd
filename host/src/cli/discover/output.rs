//! What recordings of all kinds have in common: the files of a report, names and gaps.

use std::path::Path;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::output::files::write_file;
use bodyflight_discovery::report::{Named, Outcome};
use serde::Serialize;

use crate::cli::terminal;

/// Files of a report; the last only of some verdicts.
pub(super) const FILES: &[&str] = &[
    "report.json",
    "report.svg",
    "model.toml",
    "calibration.toml",
];

/// Writes report.json, report.svg and model.toml.
pub(super) fn write_all(
    folder: &Path,
    report: &impl Serialize,
    figure: &str,
    model: &str,
) -> Result<()> {
    std::fs::create_dir_all(folder).map_err(|error| Problem::system("create", folder, error))?;
    let text = serde_json::to_string_pretty(report)
        .map_err(|error| Problem::internal("cannot write JSON").caused_by(error))?;
    write_file(&folder.join("report.json"), text.as_bytes())?;
    write_file(&folder.join("report.svg"), figure.as_bytes())?;
    write_file(&folder.join("model.toml"), model.as_bytes())
}

/// Verdict and names, which recordings of all kinds have.
pub(super) fn print_names(outcome: Outcome, effects: &[Named], nearest: &[Named]) {
    let verdict = match outcome {
        Outcome::Named => "named: an effect is missing in the model",
        Outcome::None => "none: model and data agree to the noise, as the files are",
        Outcome::Calibrated => {
            "calibrated: model and data agree once joints, subject and coefficients are adjusted within their tolerances"
        }
        Outcome::Described => "described: a load that is not in the library",
        Outcome::Unexplained => "unexplained: a disagreement like nothing in the library",
        Outcome::Thin => "thin: not enough excitation to tell effects apart",
    };
    terminal::print(&format!("verdict: {verdict}"));
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
        let sure = match named.evidence.chance {
            Some(chance) => format!("chance does as much in {:.1} % of flights", 100.0 * chance),
            None if named.evidence.deviations > 20.0 => "far beyond chance".to_owned(),
            None => format!("{:.1} deviations beyond chance", named.evidence.deviations),
        };
        terminal::print(&format!(
            "  {}: {} ({sure}{stability})",
            named.name,
            parameters.join(", "),
        ));
        if !named.rivals.is_empty() {
            let rivals: Vec<&str> = named.rivals.iter().map(|rival| rival.name).collect();
            terminal::print(&format!(
                "    indistinguishable from {} in this flight; fly: {}",
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

/// Each channel before and after, and its floor; `titles` of the first and the last column.
pub(super) fn print_gap(titles: [&str; 2], channels: &[&str], gap: [&[f64]; 3]) {
    let mut table = terminal::table(&[titles[0], "before", "after", titles[1]]);
    for (channel, name) in channels.iter().enumerate() {
        let numbers = gap.map(|values| format!("{:.3}", values[channel]));
        table.add_row([&[(*name).to_owned()][..], &numbers].concat());
    }
    terminal::print(&table.to_string());
}

/// Misfits of a recording held out: before, after, and where nothing is missing.
pub(super) fn print_held_out(
    what: &str,
    index: usize,
    [before, after, expected]: [f64; 3],
    closed: f64,
) {
    terminal::print(&format!(
        "held-out {what} {}: misfit {before:.0} -> {after:.0}, {expected:.0} where nothing is missing; {:.0} % of \
         the gap closed",
        index + 1,
        100.0 * closed
    ));
}
