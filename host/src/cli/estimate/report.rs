//! Prints the results of an estimation.

use std::path::Path;

use bodyflight_estimation::Estimation;
use bodyflight_replay::comparison::Channel;

use crate::cli::terminal;

/// Share of the time below which input counts as chance: twice the share that lies outside two standard deviations.
const SELDOM: f64 = 0.1;

/// Prints the numbers.
pub(super) fn print(estimation: &Estimation) {
    let report = &estimation.report;
    terminal::print("RMS of measured minus reconstructed, by how the inputs were found:");
    let mut columns = vec![("estimated", report.rms)];
    if let Some(free_run) = report.rms_free_run {
        columns.push(("free run", free_run));
    }
    columns.push(("constant", report.rms_constant));
    columns.push(("amplitude", report.amplitude));
    terminal::print(&terminal::gap_table(&columns).to_string());
    terminal::print(&format!(
        "{} updates, mean NIS {:.2}; {:.1} s of flight in {:.3} s of filtering; estimates come {:.2} s late",
        report.updates, report.nis_mean, report.duration_s, report.filter_s, report.delay_s
    ));
    if let Some(found) = &report.consistency {
        terminal::print(&format!(
            "consistent {:.0} %, doubtful {:.0} %, lost {:.0} % of the time{}",
            100.0 * found.consistent,
            100.0 * found.doubtful,
            100.0 * found.lost,
            report
                .joint_error_in_words()
                .map_or_else(String::new, |words| format!("; {words}"))
        ));
    }
    terminal::note_warnings(&report.warnings);
    let flags = report.flags;
    terminal::print(&format!(
        "updates with faults: posture {}, measurement {}, update {}, covariance {}, motion {}, rate {}; inconsistent {}, restarted {}",
        flags.posture,
        flags.measurement,
        flags.update,
        flags.covariance,
        flags.motion,
        flags.rate,
        flags.inconsistent,
        flags.restarted
    ));
}

/// Prints in a sentence what was found and what to do with it, unless the result is doubtful: then the error says so.
pub(super) fn print_conclusion(estimation: &Estimation, flight: &Path, out: Option<&Path>) {
    let report = &estimation.report;
    if report.doubt.is_some() {
        return;
    }
    let moved = estimation
        .active_shares()
        .into_iter()
        .max_by(|a, b| a.1.total_cmp(&b.1));
    let moved = match moved {
        Some((axis, share)) if share >= SELDOM => format!(
            "input exceeded its error bars mostly in {axis}, {:.0} % of the time",
            100.0 * share
        ),
        _ => "no input exceeded its error bars: the postures explain the flight".to_owned(),
    };
    let gain =
        |channel: &Channel| report.rms_constant.get(*channel) / report.rms.get(*channel).max(1e-9);
    let best = Channel::ALL
        .into_iter()
        .max_by(|a, b| gain(a).total_cmp(&gain(b)));
    let better = best.map_or(String::new(), |channel| {
        let (label, unit) = channel.label();
        format!(
            "; {label} is reconstructed to {:.3} {unit}, with constant coefficients to {:.3}",
            report.rms.get(channel),
            report.rms_constant.get(channel)
        )
    });
    terminal::print(&format!("In words: {moved}{better}."));
    let next = match out {
        Some(out) => format!(
            "inputs = \"{}\" in flight.toml simulates with them",
            out.display()
        ),
        None => "--out inputs.csv keeps them for flight.toml".to_owned(),
    };
    terminal::print(&format!(
        "Next: bodyflight view {} --estimate shows them over time; {next}.",
        flight.display()
    ));
}
