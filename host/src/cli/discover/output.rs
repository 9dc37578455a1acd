//! Output common to all kinds of recordings: the files of a report, the names of effects, and gaps.

use std::path::Path;

use bodyflight_discovery::named_effect::{Named, Outcome, Rival};
use bodyflight_discovery::output::report::Report;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;
use serde::Serialize;

use crate::cli::terminal;

/// Files of a report; the last is written for some verdicts only.
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

/// Prints the verdict and the named effects, for all kinds of recordings.
pub(super) fn print_names(outcome: Outcome, effects: &[Named], nearest: &[Named]) {
    let verdict = match outcome {
        Outcome::Named => "named: an effect is missing from the model",
        Outcome::None => "none: model and data agree to within the noise, without any change",
        Outcome::Calibrated => {
            "calibrated: model and data agree once joints, subject and coefficients are adjusted within their tolerances"
        }
        Outcome::Described => "described: a load that is not in the library",
        Outcome::Unexplained => "unexplained: a disagreement like nothing in the library",
        Outcome::Thin => "thin: not enough excitation to tell effects apart",
    };
    terminal::print(&format!("verdict: {verdict}"));
    for line in names(outcome, effects, nearest) {
        terminal::print(&line);
    }
}

/// The named effects, then those that were not named, under a heading.
fn names(outcome: Outcome, effects: &[Named], nearest: &[Named]) -> Vec<String> {
    let heading = if outcome == Outcome::Calibrated {
        "perhaps instead of the adjustments below (indistinguishable from them in these flights):"
    } else {
        "closest effects, not used:"
    };
    let heading = (!nearest.is_empty()).then(|| heading.to_owned());
    let mut lines: Vec<String> = effects.iter().flat_map(in_lines).collect();
    lines.extend(heading);
    lines.extend(nearest.iter().flat_map(in_lines));
    lines
}

/// An effect with its parameters and what limits their meaning.
fn in_lines(named: &Named) -> Vec<String> {
    let parameters: Vec<String> = named
        .parameters
        .iter()
        .zip(&named.standard_errors)
        .map(|((name, value), (_, error))| format!("{name} = {value:.3} +- {error:.3}"))
        .collect();
    let doubt = 100.0 * named.evidence.false_discovery_rate;
    let sure = if doubt < 0.1 {
        "acts, with a doubt below 0.1 %".to_owned()
    } else {
        format!("does not act with a probability of {doubt:.1} %")
    };
    let mut lines = vec![format!(
        "  {}: {} ({sure})",
        named.name,
        parameters.join(", "),
    )];
    if !named.rivals.is_empty() {
        let rival = |rival: &Rival| format!("{} ({:.0} %)", rival.name, 100.0 * rival.share);
        let rivals: Vec<String> = named.rivals.iter().map(rival).collect();
        lines.push(format!(
            "    it may be {} instead; to tell, fly: {}",
            rivals.join(", "),
            named.separated_by
        ));
    }
    if named.at_limit {
        lines.push(
            "    at the limit of its plausible range: something else is missing too".to_owned(),
        );
    }
    if named.imitated_by_inputs {
        lines.push("    an estimator would mistake it for muscle input and damping".to_owned());
    }
    lines
}

/// Prints each channel before and after, and its floor. `titles` are those of the first and the last column.
pub(super) fn print_gap(titles: [&str; 2], channels: &[&str], gap: [&[f64]; 3]) {
    let mut table = terminal::table(&[titles[0], "before", "after", titles[1]]);
    for (channel, name) in channels.iter().enumerate() {
        let numbers = gap.map(|values| format!("{:.3}", values[channel]));
        table.add_row([&[(*name).to_owned()][..], &numbers].concat());
    }
    terminal::print(&table.to_string());
}

/// Prints what the verdict means, and what to do next. `effects` are those named or, if the flight is calibrated, those
/// that may act instead.
pub(super) fn print_conclusion(
    report: &Report,
    effects: &[Named],
    flight: &Path,
    out: Option<&Path>,
) {
    let flight = flight.display();
    let file = |name: &str| {
        out.map_or_else(
            || format!("FOLDER/{name} of --out FOLDER"),
            |folder| folder.join(name).display().to_string(),
        )
    };
    let closes = format!("{:.0} % of the gap", 100.0 * report.gap.closed_share);
    let (words, next) = match report.verdict {
        Outcome::Named => {
            let names: Vec<&str> = effects.iter().map(|effect| effect.name).collect();
            let rival = effects.iter().find(|effect| !effect.rivals.is_empty());
            let next = match rival {
                Some(effect) => format!(
                    "to be sure of {}, fly: {}",
                    effect.name, effect.separated_by
                ),
                None => format!(
                    "bodyflight view {flight} --model {} shows the flight with it",
                    file("model.toml")
                ),
            };
            let names = names.join(" and ");
            (
                format!("the model lacks {names}, which closes {closes}"),
                next,
            )
        }
        Outcome::None => (
            "the model reproduces the measurements, as far as this flight can tell".to_owned(),
            "no change is needed; flights with other postures and speeds may show more".to_owned(),
        ),
        Outcome::Calibrated => calibrated(effects.first(), &file("calibration.toml")),
        Outcome::Described => (
            format!("a load acts that the library has no name for; the loads above close {closes}"),
            format!(
                "bodyflight view {flight} --model {} shows when it acts",
                file("model.toml")
            ),
        ),
        Outcome::Unexplained => (
            "model and data disagree, and nothing tried explains it".to_owned(),
            format!(
                "bodyflight inspect the recording first; bodyflight view {flight} --discovery {} shows where they disagree",
                file("report.json")
            ),
        ),
        Outcome::Thin => (
            "too little happens in this flight to tell effects apart".to_owned(),
            format!("fly {}", report.fly_next),
        ),
    };
    terminal::print(&format!("In words: {words}."));
    terminal::print(&format!("Next: {}.", next.trim_end_matches('.')));
}

/// What a calibrated flight means, and what to do next. `other` may act instead of the adjustments.
fn calibrated(other: Option<&Named>, file: &str) -> (String, String) {
    let numbers = format!("{file} has the numbers for subject.toml");
    match other {
        None => (
            "subject, coefficients or joints are a little off, which explains the gap".to_owned(),
            numbers,
        ),
        Some(other) => (
            format!(
                "either subject, coefficients and joints are off, or {} acts; these flights cannot tell",
                other.name
            ),
            format!(
                "to be sure of {}, fly: {}; {numbers}",
                other.name, other.separated_by
            ),
        ),
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::effect::Effect;
    use bodyflight_discovery::named_effect::EffectEvidence;

    use super::*;

    fn found(effect: Effect) -> Named {
        let evidence = EffectEvidence {
            log_odds: 6.9,
            false_discovery_rate: 0.001,
            explains: 1.0,
        };
        Named::new(effect, evidence, Vec::new())
    }

    #[test]
    fn named_effects_come_before_the_heading_of_those_that_were_not() {
        let lines = names(
            Outcome::Named,
            &[found(Effect::LocalFlow)],
            &[found(Effect::Arch)],
        );
        let place = |what: &str| lines.iter().position(|line| line.contains(what)).unwrap();
        assert!(place("local-flow") < place("closest effects, not used"));
        assert!(place("closest effects, not used") < place("arch"));
    }

    #[test]
    fn without_other_effects_there_is_no_heading() {
        let lines = names(Outcome::Named, &[found(Effect::Wind)], &[]);
        assert!(
            lines.iter().all(|line| !line.contains("closest")),
            "{lines:?}"
        );
    }
}
