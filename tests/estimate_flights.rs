//! Estimation on flights of an independent simulator, which has its own code and its own errors of joints, sensors and
//! subject.
//!
//! The flights are not part of the repository: they are expected in `shared/flights` beside it, compressed with xz. If
//! they or the `xz` program are absent, the test reports that and ends. Nothing is tuned on them.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::{Path, PathBuf};

use bodyflight_shared_data::{shared, skipped};
use std::process::Command;

use serde_json::Value;

/// Longest allowed time with an unflagged error above four standard deviations (s).
const LONGEST: f64 = 2.0;

/// Unpacks a flight and returns its `flight.toml`; `None` without `xz`.
fn unpacked(from: &Path, to: &Path) -> Option<PathBuf> {
    for name in ["flight.toml", "subject.toml", "segments.json"] {
        std::fs::copy(from.join(name), to.join(name)).expect("a file of the flight");
    }
    let packed = from.join("flight.mvnx.xz");
    let text = Command::new("xz")
        .args(["--decompress", "--stdout"])
        .arg(packed)
        .output()
        .ok()?;
    std::fs::write(to.join("flight.mvnx"), text.stdout).expect("a file");
    Some(to.join("flight.toml"))
}

/// True muscle input and damping, each [pitch, yaw, roll].
fn truth(flight: &Path) -> [f64; 6] {
    let text = std::fs::read_to_string(flight.join("truth.json")).expect("the truth");
    let truth: Value = serde_json::from_str(&text).expect("the truth is JSON");
    let pitch = truth["in_pitch"].as_f64().unwrap_or(0.0);
    let damping = truth["damp"].as_f64().unwrap_or(1.0);
    [pitch, 0.0, 0.0, 3.0 * damping, 0.5 * damping, 6.0 * damping]
}

/// Runs the estimate. Returns whether it reports doubt, and the longest uninterrupted time (s) for which any input had
/// an error above four standard deviations and was reported as consistent.
fn judged(flight: &Path, truth: [f64; 6], method: &str) -> (bool, f64) {
    let table = flight.with_file_name(format!("{method}.csv"));
    let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .arg("estimate")
        .arg(flight)
        .args(["--json", "--method", method, "--out"])
        .arg(&table)
        .output()
        .expect("the binary starts");
    let code = output.status.code();
    assert!(
        matches!(code, Some(0 | 5)),
        "{code:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(&table).expect("the table");
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let place = |name: &str| columns.iter().position(|column| *column == name);
    let names = [
        "pitch",
        "yaw",
        "roll",
        "damp_pitch",
        "damp_yaw",
        "damp_roll",
    ];
    let places = names.map(|name| {
        let deviation = place(&format!("sd_{name}")).expect("a deviation");
        (place(name).expect("an input"), deviation)
    });
    let (time, state) = (place("time_s"), place("consistency"));
    let (time, state) = (time.expect("the time"), state.expect("the state"));
    let (mut last, mut runs, mut longest) = (0.0, [0.0; 6], 0.0f64);
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |place: usize| fields[place].parse::<f64>().expect("a number");
        let now = number(time);
        for ((run, truth), (input, deviation)) in runs.iter_mut().zip(truth).zip(places) {
            let wrong = (number(input) - truth).abs() > 4.0 * number(deviation);
            let unflagged = wrong && fields[state] == "consistent";
            *run = if unflagged { *run + now - last } else { 0.0 };
            longest = longest.max(*run);
        }
        last = now;
    }
    (code == Some(5), longest)
}

#[test]
fn flights_of_another_simulator_are_consistent_or_flagged() {
    let Some(flights) = shared("flights") else {
        return;
    };
    let mut pairs: Vec<PathBuf> = std::fs::read_dir(&flights)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").path())
        .filter(|path| path.join("flight-1").is_dir())
        .collect();
    pairs.sort();
    let mut wrong = Vec::new();
    for pair in &pairs {
        for part in ["flight-0", "flight-1"] {
            let from = pair.join(part);
            let folder = tempfile::tempdir().expect("a folder");
            let Some(flight) = unpacked(&from, folder.path()) else {
                skipped("there is no xz to unpack the flights with");
                return;
            };
            for method in ["filter", "smooth"] {
                let (flagged, unflagged) = judged(&flight, truth(&from), method);
                let name = from.strip_prefix(&flights).expect("inside").display();
                let row = format!(
                    "{name}, {method}: {}, {unflagged:.2} s wrong by four deviations and not flagged",
                    if flagged {
                        "doubted as a whole"
                    } else {
                        "consistent"
                    },
                );
                println!("{row}");
                if !flagged && unflagged > LONGEST {
                    wrong.push(row);
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
