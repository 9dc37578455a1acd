//! One line of JSON for each pair of flights: what was found, whether it is right, and the errors of parameters.

use std::path::Path;
use std::time::Instant;

use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::maneuver::Maneuver;
use bodyflight_discovery::input::flight::RecordedFlight;
use bodyflight_discovery::named_effect::{Named, Outcome};
use bodyflight_discovery::output::report::Report;
use bodyflight_discovery::{Settings, discover};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_laboratory::synthesize::{Request, synthesize};
use bodyflight_laboratory::{self as laboratory, Hidden, fly};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::Subject;
use bodyflight_verbs::discover::read_track;
use serde_json::{Value, json};

use super::cases::{Case, Flown};

/// Number of standard errors that covers 95 % of normally distributed errors.
const NORMAL: f64 = 1.96;

/// Flies a pair, searches for the hidden effect, and judges the result.
pub(super) fn row(case: &Case) -> Value {
    let [flight, other] = [0, 1 << 32].map(|further| flown(case, further));
    let (begin, spent) = (Instant::now(), on_processor());
    let told = |problem: Problem| problem.to_string();
    let found = flight.map_err(told).and_then(|flight| {
        let (flights, held_out) = ([flight], [other.map_err(told)?]);
        let found = discover(&flights, &held_out, &Settings::default(), &());
        found.map_err(|problem| problem.to_string())
    });
    let seconds = begin.elapsed().as_secs_f64();
    let processor = spent.zip(on_processor()).map(|(from, to)| to - from);
    let mut row = json!({
        "group": case.group,
        "name": case.name,
        "family": case.family.name,
        "seed": case.seed,
        "sensor_noise": rounded(case.sensor_noise),
        "seconds": rounded(seconds),
        "processor_seconds": processor.map(rounded),
    });
    let found = match found {
        Ok(report) => judged(case, &report),
        // A flight that is refused or cannot be judged is a wrong answer, not a missing row.
        Err(problem) => json!({ "verdict": "failed", "why": problem, "right": false }),
    };
    if let (Some(row), Value::Object(found)) = (row.as_object_mut(), found) {
        row.extend(found);
    }
    row
}

fn flown(case: &Case, further: u64) -> Result<RecordedFlight> {
    match &case.flown {
        Flown::Laboratory(hidden) => Ok(in_laboratory(case, hidden, case.flight_seed + further)),
        Flown::Maneuver(maneuver, tunnel) => {
            let name = format!("bodyflight-bench-{}-{}", std::process::id(), case.name);
            let seed = case.seed + further;
            let folder = std::env::temp_dir().join(format!("{name}-{}-{seed}", case.group));
            let track = scripted(maneuver, *tunnel, seed, &folder);
            // If removal fails, the rest stays in the folder for temporary files.
            let _ = std::fs::remove_dir_all(&folder);
            track
        }
    }
}

fn in_laboratory(case: &Case, hidden: &[Hidden], seed: u64) -> RecordedFlight {
    let subject = Subject::default();
    let dynamics = Dynamics {
        aerodynamics: subject.aerodynamics(),
        muscles: BACK_TRACKING,
        ..Dynamics::paper(subject.body(), 1.0)
    };
    let inputs = Inputs {
        damping: subject.damping(),
        ..Inputs::belly_turn()
    };
    let settings = laboratory::Settings {
        seed,
        person: Some(case.flight_seed),
        joints: case.family.joints,
        sensor_noise: case.sensor_noise,
        rate: 120.0,
        ..laboratory::Settings::default()
    };
    let flight = fly(&dynamics, &inputs, hidden, &settings);
    RecordedFlight::new(&flight, dynamics, |_| inputs)
}

/// A script of `synth`, written and read as by a user.
fn scripted(
    maneuver: &'static Maneuver,
    tunnel: bool,
    seed: u64,
    folder: &Path,
) -> Result<RecordedFlight> {
    let subject = Subject::default();
    let request = Request {
        tunnel,
        ..Request::new(maneuver, &subject, seed)
    };
    let written = synthesize(&request, folder, &mut |_| ())?;
    read_track(&Flight::read(&written.flight)?, Options::default())
}

/// CPU time of this thread (s), if the system reports it.
fn on_processor() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

fn judged(case: &Case, report: &Report) -> Value {
    let described = report.description.as_ref();
    let by_name = |numbers: &[(&'static str, f64)]| -> Vec<f64> {
        numbers.iter().map(|(_, value)| rounded(*value)).collect()
    };
    let effects = report.effects.iter().map(|named| {
        json!({
            "name": named.name,
            "values": by_name(&named.parameters),
            "standard_errors": by_name(&named.standard_errors),
            "rivals": named.rivals.iter().map(|rival| rival.name).collect::<Vec<_>>(),
        })
    });
    let hidden = case.hidden().iter().filter_map(|hidden| match hidden {
        Hidden::Effect(_, values) => Some(values.map(rounded)),
        _ => None,
    });
    let (parameters, within) = covered(case, report);
    json!({
        "hidden": hidden.collect::<Vec<_>>(),
        "verdict": report.verdict,
        "effects": effects.collect::<Vec<_>>(),
        "described": described.map(|d| d.loads.iter().map(|l| l.in_words.clone()).collect::<Vec<_>>()),
        "described_share_held_out": described
            .and_then(|d| d.explained_held_out.first().copied())
            .map(rounded),
        "judged": report.effects.iter().chain(&report.nearest).map(|named| json!({
            "acts": 1.0 - named.evidence.false_discovery_rate,
            "is_hidden": covers(case, named),
        })).collect::<Vec<_>>(),
        "share_of_limit": share_of_limit(case, report).map(rounded),
        "nearest": report.nearest.iter().map(|named| named.name).collect::<Vec<_>>(),
        "left": report.remainders.first().map(|left| left.in_words.clone()),
        "right": is_right(case, report),
        "false_name": report.effects.iter().any(|named| !covers(case, named)),
        "parameters": parameters,
        "within_95": within,
        "misfit": report.errors.first().map(|errors| rounded(errors.misfit)),
        "wander_deg": report.errors.first().map(|errors| rounded(errors.joint_wander_deg)),
        "calibration_deg": report.errors.first().map(|errors| rounded(errors.joint_calibration_deg)),
        "held_out_closed_share": report
            .held_out
            .first()
            .map(|flight| rounded(flight.gap.closed_share)),
    })
}

/// How strong a hidden effect with a value is, as a multiple of what the report says that these flights would show by the
/// most telling of its parameters; none if it was named.
fn share_of_limit(case: &Case, report: &Report) -> Option<f64> {
    let [Hidden::Effect(effect, values)] = case.hidden() else {
        return None;
    };
    let description = effect.description();
    let limit = report
        .detectable
        .iter()
        .find(|one| one.name == description.name)?;
    let each = description.parameters.iter().zip(values).zip(&limit.least);
    let shares = each.map(|((parameter, value), (_, least))| {
        least.map_or(0.0, |least| (value - parameter.neutral).abs() / least)
    });
    Some(shares.fold(0.0, f64::max))
}

/// What is the same in a recording: the speed of the aircraft is a wind that blows from the exit on.
const SAME: [&str; 2] = ["wind", "exit-speed"];

/// Whether an effect that was named is the hidden one. That the hidden one is among its rivals does not count.
fn is_named(named: &Named, hidden: &str) -> bool {
    let is_same = SAME.contains(&named.name) && SAME.contains(&hidden);
    named.name == hidden || is_same
}

fn covers(case: &Case, named: &Named) -> bool {
    let names = case.names();
    names.iter().any(|hidden| is_named(named, hidden))
}

/// Whether the names found are those hidden.
fn is_right(case: &Case, report: &Report) -> bool {
    match case.group {
        "clean" | "maneuver" | "tunnel" => {
            matches!(
                report.verdict,
                Outcome::None | Outcome::Calibrated | Outcome::Thin
            )
        }
        "outside" | "load" => {
            matches!(report.verdict, Outcome::Unexplained | Outcome::Described)
        }
        _ => {
            let found = |name: &&str| {
                let meets = |named: &Named| is_named(named, name);
                report.effects.iter().any(meets)
            };
            let hidden = case.names();
            let named = report.verdict == Outcome::Named
                && report.effects.len() == hidden.len()
                && hidden.iter().all(found);
            named || (hidden.len() == 1 && hidden.iter().all(|name| is_adjusted(name, report)))
        }
    }
}

/// Whether the flights are `calibrated` by an adjustment of just what is hidden: the mass, which a belt adds to, or a
/// coefficient.
fn is_adjusted(name: &str, report: &Report) -> bool {
    let is_of = |what: &String| match name {
        "mass" | "weight-belt" => what.starts_with("mass of the body"),
        _ => what.starts_with(&format!("{name}, ")),
    };
    report.verdict == Outcome::Calibrated
        && report
            .adjustments
            .iter()
            .any(|adjustment| is_of(&adjustment.what) || adjustment.not_told_from.iter().any(is_of))
}

/// For the parameters of correctly named effects: their number, and how many lie within their 95 % intervals.
fn covered(case: &Case, report: &Report) -> (u64, u64) {
    let (mut all, mut within) = (0, 0);
    for hidden in case.hidden() {
        let Hidden::Effect(effect, truth) = hidden else {
            continue;
        };
        let named = report
            .effects
            .iter()
            .find(|named| named.name == effect.description().name);
        for ((found, (_, error)), truth) in named
            .iter()
            .flat_map(|named| named.parameters.iter().zip(&named.standard_errors))
            .zip(truth)
        {
            all += 1;
            within += u64::from((found.1 - truth).abs() <= NORMAL * error);
        }
    }
    (all, within)
}
