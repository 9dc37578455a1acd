//! Success rates of discovery: every effect in every family of errors, flights with nothing missing, disturbances
//! outside the library, loads drawn from the grammar, two effects at once, scripts of `synth` with their inputs.
//!
//! `cargo xtask discovery-bench --seeds 1 --first-seed 40` runs it and writes docs/discovery.json, the tables of
//! docs/discovery.md and docs/discovery-bench.svg. Rows already in the file are not flown again, so an interrupted run
//! can be continued; `--fresh` starts over. `--only clean,wind` and `--family wide` select groups, names or joint
//! errors and write nothing, `--rows FILE` keeps rows elsewhere and writes no page, `--table` regenerates tables and
//! figure.
#![expect(clippy::expect_used, reason = "a failing bench may panic")]

#[path = "discovery/cases.rs"]
mod cases;
#[path = "discovery/figure.rs"]
mod figure;
#[path = "discovery/row.rs"]
mod row;
#[path = "discovery/table.rs"]
mod table;

use std::path::PathBuf;
use std::sync::Mutex;

use cases::{Case, cases};
use rayon::ThreadPoolBuilder;
use serde_json::Value;

/// The value of an argument.
fn value(name: &str) -> Option<String> {
    let mut arguments = std::env::args().skip_while(|argument| argument != name);
    arguments.nth(1)
}

fn number(name: &str, otherwise: u64) -> u64 {
    value(name).map_or(otherwise, |text| text.parse().expect("a number"))
}

fn has(name: &str) -> bool {
    std::env::args().any(|argument| argument == name)
}

fn main() {
    if has("--table") {
        publish(&kept());
        return;
    }
    // `cargo test` also runs benches, without any arguments.
    let seeds = number("--seeds", 0);
    if seeds == 0 {
        return;
    }
    let first = number("--first-seed", 0);
    let only: Vec<String> = value("--only").map_or_else(Vec::new, |list| {
        list.split(',').map(str::to_owned).collect()
    });
    let family = value("--family");
    let looks = !only.is_empty() || family.is_some();
    let rows = if has("--fresh") || looks {
        Vec::new()
    } else {
        kept()
    };
    let in_family = |case: &Case| family.as_ref().is_none_or(|name| case.family.name == *name);
    let mut cases = cases(first..first + seeds, &only);
    cases.retain(in_family);
    let is_due = |case: &&Case| !rows.iter().any(|row| is_of(row, case));
    let mut due = spread(&cases);
    due.retain(is_due);
    println!("{} pairs of flights, {} to fly", cases.len(), due.len());
    let (due, rows) = (Mutex::new(due.into_iter()), Mutex::new(rows));
    // One pair per thread: the parts of a pair are too short to keep all cores busy.
    let work = || {
        let alone = ThreadPoolBuilder::new().num_threads(1).build();
        let alone = alone.expect("the thread should start");
        while let Some(case) = next(&due) {
            let row = alone.install(|| row::row(case));
            say(&row);
            let mut rows = rows.lock().expect("no flight should panic");
            rows.push(row);
            if !looks {
                keep(&rows);
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..number("--threads", 2) {
            scope.spawn(work);
        }
    });
    let rows = rows.into_inner().expect("no flight should panic");
    if !looks && value("--rows").is_none() {
        publish(&rows);
    } else {
        println!("{}", table::tables(&rows));
    }
}

/// Prints a row as progress.
fn say(row: &Value) {
    println!(
        "{} {} {} seed {} noise {}: {} {} {} truth {} misfit {} {} s",
        if row["right"] == true {
            "right"
        } else {
            "WRONG"
        },
        row["group"],
        row["name"],
        row["seed"],
        row["sensor_noise"],
        row["family"],
        row["verdict"],
        row["effects"],
        row["hidden"],
        row["misfit"],
        row["processor_seconds"],
    );
}

/// Orders cases so that any prefix is a representative sample, in steps of the golden section.
fn spread(cases: &[Case]) -> Vec<&Case> {
    let place = |k: usize| (k as f64 * 0.618_034).fract();
    let mut order: Vec<(usize, &Case)> = cases.iter().enumerate().collect();
    order.sort_by(|(a, _), (b, _)| place(*a).total_cmp(&place(*b)));
    order.into_iter().map(|(_, case)| case).collect()
}

/// Takes the next case.
fn next<'a>(due: &Mutex<impl Iterator<Item = &'a Case>>) -> Option<&'a Case> {
    due.lock().expect("no flight should panic").next()
}

/// Whether a row is the result of this case.
fn is_of(row: &Value, case: &Case) -> bool {
    row["group"] == case.group
        && row["name"] == case.name
        && row["seed"] == case.seed
        && row["family"] == case.family.name
}

fn docs() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../docs")
}

/// Path of the file of rows.
fn place() -> PathBuf {
    value("--rows").map_or_else(|| docs().join("discovery.json"), PathBuf::from)
}

/// Rows of an earlier run.
fn kept() -> Vec<Value> {
    let rows = std::fs::read_to_string(place()).unwrap_or_else(|_| "[]".to_owned());
    serde_json::from_str(&rows).expect("the rows should be JSON")
}

fn keep(rows: &[Value]) {
    let lines: Vec<String> = rows.iter().map(Value::to_string).collect();
    let text = format!("[\n{}\n]\n", lines.join(",\n"));
    std::fs::write(place(), text).expect("docs should be writable");
}

/// Writes tables and figure.
fn publish(rows: &[Value]) {
    let tables = table::tables(rows);
    println!("{tables}");
    let page = docs().join("discovery.md");
    let text = std::fs::read_to_string(&page).expect("the page should exist");
    let (before, rest) = text
        .split_once("<!-- table -->\n")
        .expect("the page should mark its table");
    let (_, after) = rest
        .split_once("<!-- end of the table -->")
        .expect("the page should mark the end of the table");
    let text = format!("{before}<!-- table -->\n{tables}<!-- end of the table -->{after}");
    std::fs::write(page, text).expect("docs should be writable");
    std::fs::write(docs().join("discovery-bench.svg"), figure::figure(rows))
        .expect("docs should be writable");
}
