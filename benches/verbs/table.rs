//! Each verb on one standard input.

use bodyflight_tests::text_inputs::{MAPPING, markers, track};

use crate::cost::{Program, size};
use crate::limits::Limits;

/// Length of the flights (s), their frames, and the rows of the tables.
const LENGTH: u32 = 60;
const FRAMES: f64 = 240.0 * LENGTH as f64;
const ROWS: u32 = 200_000;

/// A verb, what it reads, and how often it needs the formulas of the model and of the motion filter for each frame.
struct Row {
    arguments: &'static str,
    inputs: &'static [&'static str],
    steps: f64,
    filters: f64,
}

const fn row(
    arguments: &'static str,
    inputs: &'static [&'static str],
    steps: f64,
    filters: f64,
) -> Row {
    Row {
        arguments,
        inputs,
        steps,
        filters,
    }
}

const ONE: &[&str] = &["flight-0/flight.mvnx"];
const TWO: &[&str] = &["flight-0/flight.mvnx", "flight-1/flight.mvnx"];

const ROWS_OF_TABLE: [Row; 14] = [
    row("inspect flight-0/flight.mvnx", ONE, 0.0, 0.0),
    row("simulate flight-0/flight.toml --out a.csv", ONE, 1.0, 0.0),
    row("export flight-0/flight.toml --out b.csv", ONE, 1.0, 0.0),
    row("view flight-0/flight.toml --out c.html", ONE, 1.0, 0.0),
    row("estimate flight-0/flight.toml --out d.csv", ONE, 1.0, 1.0),
    row(
        "estimate flight-0/flight.toml --method smooth --out e.csv",
        ONE,
        1.0,
        1.0,
    ),
    row(
        "figures flight-0/flight.toml --format svg --out figures",
        ONE,
        1.0,
        1.0,
    ),
    row("technique flight-0/flight.toml", ONE, 1.0, 0.0),
    row("sensitivity flight-0/flight.toml", ONE, 1.0, 0.0),
    row(
        "compare flight-0/flight.toml flight-1/flight.toml --align start --out f.csv",
        TWO,
        2.0,
        0.0,
    ),
    row(
        "discover flight-0/flight.toml --hold-out flight-1/flight.toml",
        TWO,
        2.0,
        0.0,
    ),
    row("synth aggressive-turns --out made", &[], 0.0, 0.0),
    row("fall track.csv", &["track.csv"], 0.0, 0.0),
    row(
        "import markers.csv --mapping points.toml --out imported",
        &["markers.csv"],
        0.0,
        0.0,
    ),
];

/// Writes two flights of the laboratory.
pub(crate) fn flights(program: &Program) {
    program.seconds(
        &format!("hide clean --flights 2 --duration {LENGTH} --out . --force"),
        2,
    );
}

pub(crate) fn print(program: &Program, limits: &Limits) {
    flights(program);
    for (name, text) in [
        ("track.csv", track(ROWS)),
        ("markers.csv", markers(ROWS / 20)),
        ("points.toml", MAPPING.to_owned()),
    ] {
        std::fs::write(program.folder.join(name), text).expect("written");
    }
    println!(
        "| verb | reads (MB) | time (s) | MB/s | limit (s) | share |\n|---|---|---|---|---|---|"
    );
    for row in &ROWS_OF_TABLE {
        let seconds = program.seconds(row.arguments, 1);
        let sizes = row
            .inputs
            .iter()
            .map(|name| size(&program.folder.join(name)));
        // The sum of no numbers is -0.
        let bytes = 0.0 + sizes.sum::<f64>();
        let formulas = FRAMES * (row.steps * limits.step + row.filters * limits.filter);
        let limit = bytes * limits.byte + formulas;
        // The verb, and its method if it has several.
        let name = row.arguments.split(' ').next().unwrap_or_default();
        let is_smooth = row.arguments.contains("--method smooth");
        let method = if is_smooth { " --method smooth" } else { "" };
        println!(
            "| `{name}{method}` | {:.1} | {seconds:.2} | {:.0} | {limit:.3} | {:.1} % |",
            1e-6 * bytes,
            1e-6 * bytes / seconds,
            100.0 * limit / seconds
        );
    }
    println!();
}
