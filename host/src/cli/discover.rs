//! `bodyflight discover`.

mod args;
mod output;

use std::path::{Path, PathBuf};

use bodyflight_discovery::named_effect::Outcome;
use bodyflight_discovery::output::report::{CHANNEL_NAMES, Report};
use bodyflight_discovery::progress::Progress;
use bodyflight_io::diagnostic::Result;
use bodyflight_io::files::write_file;
use bodyflight_io::interrupt;
use bodyflight_replay::flight::Flight;
use bodyflight_verbs::discover::{
    Request, calibration_toml, discover_flights, figure, model_toml, refuse_track,
};
use indicatif::ProgressBar;

use super::terminal;
pub(super) use args::Args;
use output::{print_conclusion, print_gap, print_names, write_all};

pub(super) fn run(args: &Args, json: bool) -> Result<()> {
    let read = |path: &PathBuf| Flight::read(path);
    let flights = args.flights.iter().map(read).collect::<Result<Vec<_>>>()?;
    let held_out = args.hold_out.iter().map(read).collect::<Result<Vec<_>>>()?;
    if let Some(folder) = &args.out {
        args.outputs.check_in(folder, output::FILES)?;
    }
    for flight in flights.iter().chain(&held_out) {
        refuse_track(&flight.recording)?;
    }
    if let Some(flight) = flights.first() {
        terminal::note_assumed_subject(flight);
    }
    let request = Request {
        max_effects: args.max_effects,
    };
    let options = args.reading.options();
    let bar = terminal::share_bar("discovering");
    let report = discover_flights(&flights, &held_out, |_| options, request, &Stages(&bar));
    bar.finish_and_clear();
    let report = report?;
    for warning in &report.warnings {
        terminal::note(&format!("warning: {warning}"));
    }
    if let Some(folder) = &args.out {
        write(&report, folder, args.flight())?;
    }
    if json {
        return terminal::print_json(&report);
    }
    print_report(&report, args.explain);
    if let Some(folder) = &args.out {
        terminal::print(&format!("written: {}", folder.display()));
    }
    let effects = match report.verdict {
        Outcome::Calibrated => &report.nearest,
        _ => &report.effects,
    };
    print_conclusion(&report, effects, args.flight(), args.out.as_deref());
    Ok(())
}

/// Shows stages on the terminal, and ends the search on Ctrl-C.
struct Stages<'a>(&'a ProgressBar);

impl Progress for Stages<'_> {
    fn stage(&self, name: &str) {
        self.0.set_message(name.to_owned());
    }

    fn reached(&self, share: f64) {
        terminal::set_share(self.0, share);
    }

    fn is_cancelled(&self) -> bool {
        interrupt::requested()
    }
}

fn write(report: &Report, folder: &Path, flight: &Path) -> Result<()> {
    let title = format!("{}: what the model misses", flight.display());
    let figure = figure::svg(&title, report)?;
    write_all(
        folder,
        report,
        &figure,
        &model_toml(&report.model, report.description.as_ref()),
    )?;
    if report.verdict == Outcome::Calibrated {
        let text = calibration_toml(&report.corrections);
        write_file(&folder.join("calibration.toml"), text.as_bytes())?;
    }
    Ok(())
}

fn print_report(report: &Report, explain: bool) {
    print_names(report.verdict, &report.effects, &report.nearest);
    for change in &report.changes {
        terminal::print(&format!("{change}."));
    }
    print_description(report);
    for (index, left) in report.remainders.iter().enumerate() {
        if left.is_unexplained {
            let times: Vec<String> = left.times_s.iter().map(|t| format!("{t:.1}")).collect();
            terminal::print(&format!(
                "unexplained in flight {}: {}; mostly at {} s",
                index + 1,
                left.in_words,
                times.join(", ")
            ));
        }
    }
    if matches!(report.verdict, Outcome::Calibrated) || explain {
        print_adjustments(report);
    }
    print_detectable(report, explain);
    let gap = &report.gap;
    print_gap(
        ["channel", "noise and wander"],
        &CHANNEL_NAMES,
        [&gap.before, &gap.after, &gap.floor],
    );
    for (index, flight) in report.held_out.iter().enumerate() {
        terminal::print(&format!(
            "held-out flight {}: {:.0} % of the gap closed",
            index + 1,
            100.0 * flight.gap.closed_share
        ));
    }
    if explain {
        print_errors(report);
        terminal::print(&format!("fly next: {}", report.fly_next));
    }
}

/// Prints the loads that describe what the library does not explain, or the closest ones.
fn print_description(report: &Report) {
    let nearest = report.nearest_description.as_ref();
    if nearest.is_some() {
        terminal::print("closest loads, not used:");
    }
    let Some(described) = report.description.as_ref().or(nearest) else {
        return;
    };
    for load in &described.loads {
        terminal::print(&format!("  {}", load.in_words));
    }
    let elsewhere = described.explained_held_out.iter();
    let elsewhere: Vec<String> = elsewhere
        .map(|share| format!("{:.0} %", 100.0 * share))
        .collect();
    terminal::print(&format!(
        "    they close {:.0} % of what any load could close here; in other flights: {}",
        100.0 * described.explained,
        if elsewhere.is_empty() {
            "not tested".to_owned()
        } else {
            elsewhere.join(", ")
        }
    ));
}

/// Prints which effects these flights cannot show, and how strong the others would have to be. Where something is named,
/// only if it was asked for.
fn print_detectable(report: &Report, explain: bool) {
    let (shown, hidden): (Vec<_>, Vec<_>) = report
        .detectable
        .iter()
        .partition(|effect| effect.is_possible());
    let is_open = matches!(report.verdict, Outcome::None | Outcome::Calibrated);
    if !hidden.is_empty() && (is_open || explain) {
        let names: Vec<&str> = hidden.iter().map(|effect| effect.name).collect();
        terminal::print(&format!(
            "not seen in these flights even if as strong as is plausible: {}",
            names.join(", ")
        ));
    }
    if !explain || shown.is_empty() {
        return;
    }
    terminal::print(
        "to first order, 19 of 20 such flights show an effect if a parameter differs by:",
    );
    for effect in shown {
        let each = effect.least.iter().map(|(name, least)| match least {
            Some(least) => format!("{name} {least:.*}", if *least < 0.1 { 3 } else { 2 }),
            None => format!("{name} more than is plausible"),
        });
        let each: Vec<String> = each.collect();
        terminal::print(&format!("  {}: {}", effect.name, each.join(", ")));
    }
}

/// Prints the errors found in the subject, the coefficients and the joints.
fn print_adjustments(report: &Report) {
    for adjustment in &report.adjustments {
        let alike = if adjustment.not_told_from.is_empty() {
            String::new()
        } else {
            format!(
                "; indistinguishable from {} in this flight",
                adjustment.not_told_from.join(", ")
            )
        };
        terminal::print(&format!(
            "  {}: {:.3} +- {:.3}, in the files {:.3}, combined {:.3}{alike}",
            adjustment.what,
            adjustment.value,
            adjustment.standard_error,
            adjustment.in_files,
            adjustment.corrected
        ));
    }
    for joint in &report.joints {
        let turns: Vec<String> = joint
            .turn_deg
            .iter()
            .zip(joint.standard_errors_deg)
            .map(|(turn, error)| format!("{turn:.1} +- {error:.1}"))
            .collect();
        terminal::print(&format!(
            "  joint of {}: seen off by {} degrees about x, y, z",
            joint.segment,
            turns.join(", ")
        ));
    }
}

/// Prints the estimated sizes of the errors.
fn print_errors(report: &Report) {
    for (index, errors) in report.errors.iter().enumerate() {
        let [attitude, spin, horizontal, vertical] = errors.sensors;
        terminal::print(&format!(
            "errors seen in flight {}: sensors {attitude:.4} rad, {spin:.3} rad/s, {horizontal:.2} and {vertical:.2} m/s; \
             joints {:.1} degrees, wandering by {:.1}, {:.0} % of the bend; misfit {:.2} relative to these errors",
            index + 1,
            errors.joint_calibration_deg,
            errors.joint_wander_deg,
            100.0 * errors.joint_bend,
            errors.misfit
        ));
    }
}
