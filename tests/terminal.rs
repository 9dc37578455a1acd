//! What a terminal shows: tables that fit it, and completions that know the names of closed sets.

use std::path::Path;

use bodyflight_tests::program::{Program, plain, text, written};
use bodyflight_tests::small_recording;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// Width of a terminal (columns).
const WIDTH: usize = 80;

/// Real flights that the program includes.
const FLIGHTS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../verbs/data/acrobatics");

/// Whether a line is one of a table: it has a frame, or columns.
fn is_of_table(line: &str) -> bool {
    let has_columns = line
        .trim()
        .split("  ")
        .filter(|cell| !cell.is_empty())
        .count()
        > 2;
    line.contains(['│', '┆', '─', '═']) || has_columns
}

/// A track of a jump as a logger writes it: an aircraft, a fall of 50 m/s, a canopy.
fn track() -> String {
    let mut rows = "time_s,north_m,east_m,height_m,north_mps,east_mps,up_mps\n".to_owned();
    let (mut height, mut rate, mut north) = (4000.0_f64, 0.0_f64, 0.0_f64);
    for step in 0..1400 {
        let time = f64::from(step) * 0.2;
        let (to, ahead) = match time {
            time if time < 20.0 => (0.0, 45.0),
            time if time < 75.0 => (-52.0, 8.0),
            _ => (-5.0, 10.0),
        };
        rate += (to - rate) * 0.05;
        height = (height + 0.2 * rate).max(0.0);
        north += 0.2 * ahead;
        rows += &format!("{time},{north},0,{height},{ahead},0,{rate}\n");
    }
    rows
}

#[test]
fn tables_fit_a_terminal() {
    let folder = tempfile::tempdir().expect("a folder");
    let at = |name: &str| plain(&folder.path().join(name)).to_owned();
    let flight = written(folder.path(), "flight.mvnx", &small_recording::written(480));
    let jump = written(folder.path(), "jump.csv", &track());
    let [one, three] = ["flight-1", "flight-3"].map(|name| format!("{FLIGHTS}/{name}.toml"));
    let first = format!("{FLIGHTS}/flight-1.mvnx.gz");
    let cards = at("cards");
    std::fs::create_dir(&cards).expect("a folder");
    written(Path::new(&cards), "jump.csv", &track());
    let lab = at("lab");
    let calls: [&[&str]; 17] = [
        &["simulate", &one],
        &["simulate", &one, "--joint", "l_shank.bend=+20"],
        &["simulate", &one, &three],
        &["estimate", &flight],
        &["estimate", &flight, "--preset", "turning"],
        &["estimate", "--presets"],
        &["sensitivity", &flight],
        &["sensitivity", &flight, "--preset", "turning"],
        &["trim"],
        &["compare", &one, &three],
        &["technique", &one],
        &["airborne", &first],
        &[
            "tune",
            &one,
            "--draws",
            "1",
            "--hold-out",
            &three,
            "--per-segment",
        ],
        &["inspect", &first],
        &["fall", &jump],
        &["fall", &cards],
        &[
            "hide",
            "clean",
            "--duration",
            "5",
            "--flights",
            "1",
            "--out",
            &lab,
        ],
    ];
    let mut wrong = Vec::new();
    for call in calls {
        let said = text(&PROGRAM.run(call).stdout);
        assert!(!said.is_empty(), "{call:?} says nothing");
        let wide = said.lines().filter(|line| is_of_table(line));
        let wide = wide.filter(|line| line.chars().count() > WIDTH);
        wrong.extend(wide.map(|line| format!("{call:?}: {line}")));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_cell_of_numbers_is_torn() {
    let flight = format!("{FLIGHTS}/flight-1.toml");
    let said = text(&PROGRAM.run(&["sensitivity", &flight]).stdout);
    let rows = said.lines().filter(|line| line.contains(" % "));
    // Nine parameters, each smaller and larger, in one line each.
    assert_eq!(
        rows.filter(|row| row.matches('%').count() == 5).count(),
        18,
        "{said}"
    );
}

#[cfg(feature = "full")]
#[test]
fn completions_know_the_names_of_closed_sets() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = text(&PROGRAM.run(&["completions", shell]).stdout);
        // Maneuvers, effects, presets, experiments, and views, as far as the shell's script completes values.
        let names: &[&str] = match shell {
            "bash" | "zsh" | "fish" => &[
                "barrel-roll",
                "wind",
                "clean",
                "turning-experienced",
                "oscillation-map",
                "front",
            ],
            _ => &["synth"],
        };
        for name in names {
            assert!(script.contains(name), "{shell} does not know {name}");
        }
    }
}

#[test]
fn help_lists_what_completions_know() {
    for (verb, name) in [
        ("synth", "barrel-roll"),
        ("hide", "wind"),
        ("reproduce", "oscillation-map"),
        ("figures", "front"),
    ] {
        let said = text(&PROGRAM.run(&[verb, "--help"]).stdout);
        assert!(said.contains(name), "{verb} --help: {said}");
    }
}
