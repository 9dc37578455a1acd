//! How often discovery finds what was hidden: every effect, clean flights, things outside the library, two effects
//! at once, in families of errors. Writes `docs/discovery.json` and the table of `docs/discovery.md`.
//!
//! `cargo xtask discovery-bench --seeds 2` runs it; `--only wind,mass` looks at some effects and writes nothing,
//! `--more` keeps the rows there are, `--table` makes the table again from the rows.
#![expect(clippy::expect_used, reason = "a bench may end with a panic")]

#[path = "discovery/table.rs"]
mod table;

use std::path::PathBuf;
use std::sync::Mutex;
use std::thread::available_parallelism;
use std::time::Instant;

use bodyflight::formats::subject::Subject;
use bodyflight_core::dynamics::muscle_input::BACK_TRACKING;
use bodyflight_core::dynamics::{Dynamics, Inputs};
use bodyflight_core::effect::Effect;
use bodyflight_discovery::laboratory::outside::Outside;
use bodyflight_discovery::laboratory::{self, Hidden, JointErrors, fly, strength};
use bodyflight_discovery::report::{Outcome, Report};
use bodyflight_discovery::search::{Settings, discover};
use bodyflight_discovery::track::Track;
use rayon::ThreadPoolBuilder;
use serde_json::{Value, json};
use table::table;

/// What the suit has wrong with the joints, and how noisy its sensors are beside the paper's.
struct Family {
    name: &'static str,
    joints: JointErrors,
    sensor_noise: f64,
}

const fn family(
    name: &'static str,
    [constant_deg, wander_deg, gain]: [f64; 3],
    sensor_noise: f64,
) -> Family {
    Family {
        name,
        joints: JointErrors {
            constant_deg,
            wander_deg,
            wander_hz: 0.3,
            gain,
        },
        sensor_noise,
    }
}

/// All families: each effect is hidden in each of them.
const FAMILIES: [Family; 4] = [
    family("constant", [1.1, 0.0, 0.0], 1.0),
    family("wander", [0.0, 1.1, 0.0], 0.5),
    family("mixed", [1.1, 0.9, 0.05], 1.0),
    family("wide", [2.9, 2.3, 0.08], 2.0),
];

/// What is hidden in a run.
struct Case {
    group: &'static str,
    family: &'static Family,
    name: String,
    hidden: Vec<Hidden>,
    seed: u64,
}

fn effect(effect: Effect, seed: u64) -> Hidden {
    Hidden::Effect(effect, strength(effect, seed, None))
}

/// Effects that are hidden together.
const PAIRS: [(Effect, Effect); 5] = [
    (Effect::Wind, Effect::Mass),
    (Effect::Drag, Effect::GyroBias),
    (Effect::Lift, Effect::HeadingDrift),
    (Effect::Moment, Effect::Wind),
    (Effect::Damping, Effect::Mounting),
];

fn cases(seeds: u64, only: &[String]) -> Vec<Case> {
    let mut cases = Vec::new();
    for (seed, family) in
        (0..seeds).flat_map(|seed| FAMILIES.iter().map(move |family| (seed, family)))
    {
        let mut add = |group, name: String, hidden: Vec<Hidden>, seed| {
            if only.is_empty() || only.contains(&name) {
                cases.push(Case {
                    group,
                    family,
                    name,
                    hidden,
                    seed,
                });
            }
        };
        // A profile of the stream acts in a tunnel only, and these flights fall through still air.
        let felt = |effect: &&Effect| **effect != Effect::TunnelProfile;
        for &one in Effect::ALL.iter().filter(felt) {
            let name = one.description().name.to_owned();
            add("single", name, vec![effect(one, seed)], seed);
        }
        for outside in Outside::ALL {
            let name = outside.name().to_owned();
            add("outside", name, vec![Hidden::Outside(outside)], seed);
        }
        for seed in 5 * seed..5 * (seed + 1) {
            add("clean", "clean".to_owned(), vec![], seed);
        }
        for (a, b) in PAIRS {
            let name = format!("{} + {}", a.description().name, b.description().name);
            add(
                "pair",
                name,
                vec![effect(a, seed), effect(b, seed + 77)],
                seed,
            );
        }
    }
    cases
}

fn names(hidden: &[Hidden]) -> Vec<&'static str> {
    let name = |hidden: &Hidden| match hidden {
        Hidden::Effect(effect, _) => effect.description().name,
        Hidden::Outside(outside) => outside.name(),
        Hidden::Load(_) => "load",
    };
    hidden.iter().map(name).collect()
}

/// Whether the names found are those hidden; one of several that cannot be told apart counts.
fn is_right(case: &Case, report: &Report) -> bool {
    let hidden = names(&case.hidden);
    match case.group {
        "clean" => matches!(report.verdict, Outcome::None | Outcome::Calibrated),
        "outside" => matches!(report.verdict, Outcome::Unexplained | Outcome::Described),
        _ => {
            let covers = |name: &str| {
                let meets = |named: &bodyflight_discovery::report::Named| {
                    named.name == name || named.rivals.iter().any(|rival| rival.name == name)
                };
                report.effects.iter().any(meets)
            };
            report.verdict == Outcome::Named
                && report.effects.len() == hidden.len()
                && hidden.iter().all(|name| covers(name))
        }
    }
}

/// Of the parameters of a rightly named effect: how many, and how many within three standard errors.
fn errors(case: &Case, report: &Report) -> (u64, u64) {
    let (mut all, mut within) = (0, 0);
    for hidden in &case.hidden {
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
            within += u64::from((found.1 - truth).abs() <= 3.0 * error);
        }
    }
    (all, within)
}

/// Whether the names found are exactly those hidden.
fn is_exact(case: &Case, report: &Report) -> bool {
    let mut hidden = names(&case.hidden);
    let mut found: Vec<&str> = report.effects.iter().map(|named| named.name).collect();
    hidden.sort_unstable();
    found.sort_unstable();
    hidden == found
}

fn run(case: &Case, dynamics: &Dynamics<f64>, inputs: &Inputs<f64>) -> Value {
    let settings = laboratory::Settings {
        seed: case.seed,
        joints: case.family.joints,
        sensor_noise: case.family.sensor_noise,
        rate: 120.0,
        ..laboratory::Settings::default()
    };
    let track = |seed| {
        let flight = fly(
            dynamics,
            inputs,
            &case.hidden,
            &laboratory::Settings { seed, ..settings },
        );
        Track::new(&flight, *dynamics, |_| *inputs)
    };
    let begin = Instant::now();
    let (flown, other) = (track(case.seed), track(case.seed + 5000));
    let found = discover(&[flown], &[other], &Settings::default(), &());
    let report = match found {
        Ok(report) => report,
        // A flight that cannot be judged is a wrong answer, not a missing row.
        Err(problem) => {
            println!(
                "{:8} {:28} seed {}: {problem}",
                case.group, case.name, case.seed
            );
            return json!({
                "group": case.group,
                "hidden": names(&case.hidden),
                "seed": case.seed,
                "family": case.family.name,
                "verdict": "failed",
                "effects": [],
                "right": false,
                "exact": false,
            });
        }
    };
    let seconds = begin.elapsed().as_secs_f64();
    let (parameters, within) = errors(case, &report);
    let right = is_right(case, &report);
    let found: Vec<&str> = report.effects.iter().map(|named| named.name).collect();
    println!(
        "{:8} {:28} seed {} {:8}: {} {:?} {found:?} {:.0} s",
        case.group,
        case.name,
        case.seed,
        case.family.name,
        if right { "right" } else { "WRONG" },
        report.verdict,
        seconds
    );
    json!({
        "group": case.group,
        "hidden": names(&case.hidden),
        "seed": case.seed,
        "family": case.family.name,
        "verdict": report.verdict,
        "effects": report.effects,
        "right": right,
        "exact": is_exact(case, &report),
        "nearest": report.nearest.iter().map(|named| named.name).collect::<Vec<_>>(),
        "parameters": parameters,
        "within_three_standard_errors": within,
        "misfit": report.errors.first().map(|errors| errors.misfit),
        "seconds": seconds,
        "explained": report.explained,
        "held_out_closed_share": report.held_out.first().map(|flight| flight.gap.closed_share),
        "held_out_worse": report.held_out.iter().any(|flight| flight.gain < 0.0),
    })
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let value = |name: &str| {
        let place = arguments.iter().position(|argument| argument == name)?;
        arguments.get(place + 1).cloned()
    };
    let has = |name: &str| arguments.iter().any(|argument| argument == name);
    let kept = || -> Vec<Value> {
        let rows = std::fs::read_to_string(docs().join("discovery.json")).expect("there are rows");
        serde_json::from_str(&rows).expect("the rows are JSON")
    };
    if has("--table") {
        let rows = kept();
        write(&rows, &table(&rows));
        return;
    }
    // `cargo test` runs benches without asking for one.
    let Some(seeds) = value("--seeds") else {
        return;
    };
    let seeds = seeds.parse().expect("--seeds is a number");
    let only: Vec<String> = value("--only").map_or_else(Vec::new, |list| {
        list.split(',').map(str::to_owned).collect()
    });
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
    let rows: Vec<Value> = if has("--more") { kept() } else { Vec::new() };
    let cases = cases(seeds, &only);
    let is_due = |case: &&Case| !rows.iter().any(|row| is_of(row, case));
    let due: Vec<&Case> = cases.iter().filter(is_due).collect();
    let (due, rows) = (Mutex::new(due.into_iter()), Mutex::new(rows));
    // A flight on each core: its own parts are too short to keep all cores busy.
    let work = || {
        let alone = ThreadPoolBuilder::new().num_threads(1).build();
        let alone = alone.expect("a thread starts");
        while let Some(case) = next(&due) {
            let row = alone.install(|| run(case, &dynamics, &inputs));
            let mut rows = rows.lock().expect("no flight ends with a panic");
            rows.push(row);
            rows.sort_by_key(|row| cases.iter().position(|case| is_of(row, case)));
            // A run that is cut short keeps its rows; `--table` makes the table of them.
            if only.is_empty() {
                keep(&rows);
            }
        }
    };
    let cores = available_parallelism().map_or(1, usize::from);
    std::thread::scope(|scope| {
        for _ in 0..cores {
            scope.spawn(work);
        }
    });
    let rows = rows.into_inner().expect("no flight ends with a panic");
    let table = table(&rows);
    println!("{table}");
    if only.is_empty() {
        write(&rows, &table);
    }
}

/// The next case, for whoever asks first.
fn next<'a>(due: &Mutex<impl Iterator<Item = &'a Case>>) -> Option<&'a Case> {
    due.lock().expect("no flight ends with a panic").next()
}

/// Whether a row came of this case.
fn is_of(row: &Value, case: &Case) -> bool {
    row["group"] == case.group
        && row["hidden"] == json!(names(&case.hidden))
        && row["seed"] == case.seed
        && row["family"] == case.family.name
}

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

fn keep(rows: &[Value]) {
    let lines: Vec<String> = rows.iter().map(Value::to_string).collect();
    std::fs::write(
        docs().join("discovery.json"),
        format!("[\n{}\n]\n", lines.join(",\n")),
    )
    .expect("docs are writable");
}

fn write(rows: &[Value], table: &str) {
    keep(rows);
    let docs = docs();
    let page = docs.join("discovery.md");
    let text = std::fs::read_to_string(&page).expect("the page is there");
    let (before, rest) = text
        .split_once("<!-- table -->\n")
        .expect("the page marks its table");
    let (_, after) = rest
        .split_once("<!-- end of the table -->")
        .expect("the page marks the end");
    let text = format!("{before}<!-- table -->\n{table}<!-- end of the table -->{after}");
    std::fs::write(page, text).expect("docs are writable");
}
