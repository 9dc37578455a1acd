//! docs/formats.md names every column and every field that the program writes.

#![expect(
    clippy::panic,
    clippy::unwrap_used,
    reason = "tests may panic: that is how they fail"
)]

use std::collections::BTreeSet;
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_replay::comparison::Channel;
use bodyflight_shared_data::shared;
use bodyflight_tests::program::{Program, plain};
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));
const PAGE: &str = include_str!("../docs/formats.md");

/// Fields whose contents the page does not list: parameters of effects by name, and copies of files.
const BY_NAME: [&str; 3] = ["parameters", "standard_errors", "least"];
const COPIES: [&str; 2] = ["model", "corrections"];

/// Texts between backticks in the section of the page whose heading contains `title`.
fn names_below(title: &str) -> BTreeSet<&'static str> {
    let part = PAGE
        .split("\n## ")
        .flat_map(|part| part.split("\n### "))
        .find(|part| part.lines().next().is_some_and(|head| head.contains(title)));
    let part = part.unwrap_or_else(|| panic!("no heading with {title}"));
    part.split('`').skip(1).step_by(2).collect()
}

/// Paths of all leaves, with `[]` for entries of lists and `*` for channels and parameters.
fn paths(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    let last = path.rsplit('.').next().unwrap_or(path);
    match value {
        Value::Object(_) | Value::Array(_) if COPIES.contains(&last) => {
            found.insert(path.to_owned());
        }
        Value::Object(fields) => {
            for (key, value) in fields {
                let is_channel = Channel::ALL.iter().any(|channel| channel.key() == key);
                let key = if is_channel || BY_NAME.contains(&last) {
                    "*"
                } else {
                    key
                };
                let dot = if path.is_empty() { "" } else { "." };
                paths(value, &format!("{path}{dot}{key}"), found);
            }
        }
        Value::Array(entries) => {
            let path = format!("{path}[]");
            if entries.is_empty() {
                found.insert(path.clone());
            }
            for entry in entries {
                paths(entry, &path, found);
            }
        }
        _ => {
            found.insert(path.to_owned());
        }
    }
}

/// Maps the fields of `nearest` to those of `effects`, since the page lists them once for both.
fn as_effect(path: &str) -> String {
    path.replacen("nearest[].", "effects[].", 1)
}

/// Whether the page names a path: in full, or its beginning and the remainder separately.
fn is_named(path: &str, names: &BTreeSet<&str>) -> bool {
    names.contains(path)
        || path.match_indices('.').any(|(at, _)| {
            let (whole, rest) = (&path[..at], &path[at + 1..]);
            names.contains(whole) && names.contains(rest)
        })
        // The same for a list and the fields of its entries.
        || path
            .split_once("[].")
            .is_some_and(|(list, rest)| names.contains(&*format!("{list}[]")) && names.contains(rest))
}

fn check(title: &str, answer: &Value) {
    let names = names_below(title);
    let mut found = BTreeSet::new();
    paths(answer, "", &mut found);
    let before = found.len();
    // `made_by` is the same in every result.
    found.retain(|path| !path.starts_with("made_by."));
    let is_problem = answer.get("error").is_some();
    assert!(
        is_problem || found.len() < before,
        "{title}: who made it? {answer}"
    );
    assert!(found.len() > 1, "{title}: {answer}");
    let missing: Vec<_> = found
        .iter()
        .filter(|path| !is_named(&as_effect(path), &names))
        .collect();
    assert!(
        missing.is_empty(),
        "{title}: docs/formats.md lacks {missing:?}"
    );
}

fn header(path: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(path).unwrap();
    let head = text.lines().next().unwrap();
    head.split(',').map(str::to_owned).collect()
}

#[test]
fn every_field_and_column_of_a_flight_is_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let named = |name: &str| plain(&at(name)).to_owned();
    let out = named("flight");
    check(
        "Others",
        &PROGRAM.json(&["synth", "rotations", "--out", &out]),
    );
    check("Others", &PROGRAM.json(&["trim"]));
    check("Others", &PROGRAM.json(&["sensitivity", &out]));
    check("Others", &PROGRAM.json(&["tune", &out, "--draws", "2"]));
    check(
        "`inspect`",
        &PROGRAM.json(&["inspect", &named("flight/flight.mvnx")]),
    );
    let run = named("run.csv");
    check(
        "`simulate`, `demo`",
        &PROGRAM.json(&["simulate", &out, "--out", &run]),
    );
    let found = named("found.csv");
    let (estimate, _) = PROGRAM.answer(&["estimate", &out, "--out", &found]);
    check("`estimate`", &estimate);

    let exported = named("exported.csv");
    let arguments = ["export", &out, "--estimates", "--out", &exported];
    check("Others", &PROGRAM.answer(&arguments).0);

    let inputs = names_below("`inputs.csv`");
    for column in header(&at("flight/inputs.csv")) {
        assert!(inputs.contains(&*column), "{column}");
    }
    let estimates = names_below("`estimate --out`");
    for column in header(&at("found.csv")) {
        assert!(
            estimates.contains(&*column) || inputs.contains(&*column),
            "{column}"
        );
    }
    let channels = names_below("`simulate --out`");
    for column in header(&at("run.csv")) {
        let channel = ["measured_", "simulated_"]
            .iter()
            .find_map(|side| column.strip_prefix(side));
        assert!(channels.contains(channel.unwrap_or(&column)), "{column}");
    }
    check_exported(&header(&at("exported.csv")), &channels);
}

/// Asserts that the page names every exported column and no others, with `*` for the name of a segment.
fn check_exported(columns: &[String], channels: &BTreeSet<&str>) {
    let named = names_below("`export`");
    let mut found = BTreeSet::new();
    for column in columns {
        let of_segment = Segment::ALL.iter().find_map(|segment| {
            let tail = column.strip_prefix(segment.name())?;
            tail.starts_with('_').then(|| format!("*{tail}"))
        });
        let name = of_segment.unwrap_or_else(|| column.clone());
        let side = ["measured_", "simulated_"].map(|side| name.strip_prefix(side));
        let is_channel = side.iter().flatten().any(|tail| channels.contains(tail));
        assert!(is_channel || named.contains(&*name), "{column}");
        found.insert(name);
    }
    let is_column = |name: &&&str| {
        let ends = ["_m", "_mps", "_radps", "_rad", "_n", "_nm", "_m2", "_m3"];
        let begins = ["*_", "simulated_", "measured_", "estimated_"];
        let sides = ["measured_*", "simulated_*"].contains(*name);
        !sides
            && begins.iter().any(|begin| name.starts_with(begin))
            && ends.iter().any(|end| name.ends_with(end))
    };
    for name in named.iter().filter(is_column) {
        // Arrays of the NumPy format are described below the table and are not columns.
        let is_array = *name == "measured_position_m";
        assert!(is_array || found.contains(*name), "{name} is not a column");
    }
}

#[test]
fn every_field_of_a_search_is_on_the_page() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("lab");
    let out = plain(&out);
    check("Others", &PROGRAM.json(&["hide", "wind", "--out", out]));
    let flights = [0, 1].map(|number| format!("{out}/flight-{number}/flight.toml"));
    let [fitted, held_out] = &flights;
    let report = PROGRAM.json(&["discover", fitted, "--hold-out", held_out]);
    check("`discover`", &report);
    // This is the example of the README.
    assert_eq!(
        report["effects"][0]["name"], "wind",
        "{}",
        report["verdict"]
    );
}

#[test]
fn every_field_of_real_flights_is_on_the_page() {
    check("Others", &PROGRAM.json(&["validate"]));
    let Some(track) = shared("data/flysight/skyderby/speed_skydiving_411.csv") else {
        return;
    };
    check("`fall`", &PROGRAM.answer(&["fall", plain(&track)]).0);
}

#[test]
fn every_part_of_a_problem_is_on_the_page() {
    let output = PROGRAM.run(&["simulate", "there-is-none.toml", "--json"]);
    check("Others", &serde_json::from_slice(&output.stderr).unwrap());
}
