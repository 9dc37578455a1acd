//! Estimation on flights of an independent simulator, which has its own code and its own errors of joints, sensors and
//! subject.
//!
//! The flights are not part of the repository: they are expected in `shared/flights` beside it, compressed with xz. If
//! they or the `xz` program are absent, the test reports that and ends. Nothing is tuned on them.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::{Path, PathBuf};

use bodyflight_core::estimator::motion::watch::Consistency;
use bodyflight_estimation::motion::{self, Settings};
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_shared_data::{shared, skipped};
use bodyflight_tests::receiver::Receiver;
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

/// Runs the estimate. Returns its report, whether it reports doubt, and muscle input and damping by time, each with its
/// standard deviation.
fn estimated(flight: &Path) -> (Value, bool, Vec<[(f64, f64); 6]>) {
    let table = flight.with_file_name("filter.csv");
    let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .arg("estimate")
        .arg(flight)
        .args(["--json", "--force", "--out"])
        .arg(&table)
        .output()
        .expect("the binary starts");
    let code = output.status.code();
    assert!(
        matches!(code, Some(0 | 5)),
        "{code:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    let report = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = std::fs::read_to_string(&table).expect("the table");
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().expect("a head").split(',').collect();
    let place = |name: &str| {
        let place = columns.iter().position(|column| *column == name);
        place.expect("a column of that name")
    };
    let names = [
        "pitch",
        "yaw",
        "roll",
        "damp_pitch",
        "damp_yaw",
        "damp_roll",
    ];
    let places = names.map(|name| (place(name), place(&format!("sd_{name}"))));
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |place: usize| fields[place].parse::<f64>().expect("a number");
        places.map(|(input, deviation)| (number(input), number(deviation)))
    };
    (report, code == Some(5), lines.map(row).collect())
}

/// Estimates a flight as the program does, by filter and by smoother. Returns whether each reports doubt, and the longest
/// uninterrupted time (s) for which any input had an error above four standard deviations and was reported as consistent.
fn judged(flight: &Path, truth: [f64; 6]) -> [(bool, f64); 2] {
    let flight = Flight::read(flight).expect("a flight");
    let settings = Settings::usual(&flight.subject);
    let both = motion::estimate_both(&flight, &settings, Options::default(), Precision::Double);
    both.expect("estimates").map(|estimation| {
        let (mut last, mut runs, mut longest) = (0.0, [0.0; 6], 0.0f64);
        for point in &estimation.points {
            let [_, found @ ..] = point.inputs.columns();
            let [_, deviation @ ..] = point.deviation.columns();
            for (k, run) in runs.iter_mut().enumerate() {
                let wrong = (found[k] - truth[k]).abs() > 4.0 * deviation[k];
                let unflagged = wrong && point.consistency == Some(Consistency::Consistent);
                *run = if unflagged {
                    *run + point.time - last
                } else {
                    0.0
                };
                longest = longest.max(*run);
            }
            last = point.time;
        }
        (estimation.report.doubt.is_some(), longest)
    })
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
            let both = judged(&flight, truth(&from));
            for (method, (flagged, unflagged)) in ["filter", "smooth"].into_iter().zip(both) {
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

/// Velocities between a receiver's solutions are interpolated, and count as no measurements: otherwise three quarters of these
/// estimates are doubtful.
#[test]
fn a_receiver_at_any_rate_is_agreed_with() {
    let Some(flights) = shared("flights") else {
        return;
    };
    // Solutions in a second, and how long errors last (s).
    let receivers = [(5.0, 0.0), (10.0, 2.0), (1.0, 0.0)];
    let mut shares = Vec::new();
    for pair in ["none-mixed-102", "none-slow-101"] {
        let from = flights.join(pair).join("flight-0");
        let folder = tempfile::tempdir().expect("a folder");
        let Some(flight) = unpacked(&from, folder.path()) else {
            skipped("there is no xz to unpack the flights with");
            return;
        };
        let text = std::fs::read_to_string(&flight).expect("the flight");
        std::fs::write(&flight, format!("gnss = \"TRACK.CSV\"\n{text}")).expect("a file");
        for (rate, lasts) in receivers {
            let receiver = Receiver {
                rate,
                deviation: 0.25,
                lasts,
                before: 6.4,
            };
            let track = receiver.track(&folder.path().join("flight.mvnx"), 3);
            std::fs::write(folder.path().join("TRACK.CSV"), track).expect("a file");
            let (report, is_doubted, rows) = estimated(&flight);
            let name = format!("{pair}, {rate} Hz, errors of {lasts} s");
            assert!(!is_doubted, "{name}: {report}");
            let share = report["consistency"]["consistent"].as_f64();
            shares.push((name.clone(), share.expect("a share")));
            let truth = truth(&from);
            let ratios = rows.iter().flat_map(|row| {
                let pairs = row.iter().zip(truth).take(3);
                pairs.map(|((found, deviation), truth)| ((found - truth) / deviation).powi(2))
            });
            let ratios: Vec<f64> = ratios.collect();
            let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
            assert!(mean < 1.3, "{name}: {mean}");
        }
    }
    let mean = shares.iter().map(|(_, share)| share).sum::<f64>() / shares.len() as f64;
    assert!(mean > 0.9, "{mean}: {shares:?}");
}
