//! A unit that no host ever greets: a stored configuration and the bytes of a sensor.

use std::path::Path;
use std::process::Output;
use std::time::Duration;

use bodyflight_shared_data::shared;
use serde_json::Value;

use super::{Unit, bodyflight, log, report, text};

/// Makes a synthetic flight with the bytes of a sensor; returns its `flight.toml` and `imu.bin`.
fn sensed(folder: &Path) -> [String; 2] {
    let out = folder.join("flight");
    let output = bodyflight()
        .args(["synth", "tracking", "--seed", "5", "--imu", "--out"])
        .arg(&out)
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    ["flight.toml", "imu.bin"].map(|name| out.join(name).display().to_string())
}

fn alone(arguments: &[&str]) -> Output {
    bodyflight()
        .args(["--json", "stream"])
        .args(arguments)
        .output()
        .expect("the binary starts")
}

/// Runs a verb that must fail with `code`; returns its message in one line.
fn refused(arguments: &[&str], code: i32) -> String {
    let output = alone(arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn the_desk_flies_a_sensors_bytes_and_writes_what_a_log_would_hold() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, bytes] = sensed(folder.path());
    let out = folder.path().join("alone").display().to_string();
    let flown = |rate| ["--sensor", &bytes, "--rate", rate, "--log", &out].to_vec();
    let found = report(&alone(&[&[flight.as_str()][..], &flown("240")].concat()));
    assert_eq!(found["used"], 7200);
    assert_eq!(found["missing"], 0);
    assert_eq!(found["receiver_solutions"], 150);
    assert_eq!(found["estimates_bad"], 0);
    assert!(found["consistent"].as_f64() > Some(0.95), "{found}");
    // What was written is a flight for every verb.
    let written = found["written"]["flight"].as_str().expect("a path");
    let recording = written.replace("flight.toml", "flight.mvnx");
    let inspected = bodyflight().args(["inspect", &recording]).output();
    let inspected = inspected.expect("the binary starts");
    assert!(inspected.status.success(), "{}", text(&inspected.stderr));
    let table = std::fs::read_to_string(folder.path().join("alone/estimates.csv"));
    let table = table.expect("a table");
    let last: Vec<f64> = (table.lines().last().expect("rows").split(','))
        .map(|number| number.parse().expect("a number"))
        .collect();
    let velocity = &last[last.len() - 3..];
    for (column, part) in velocity.iter().enumerate() {
        let same = found["last"]["velocity_mps"][column].as_f64();
        assert!((part - same.expect("a number")).abs() < 1e-4);
    }
    // A sensor that says the same again and again is no flight.
    let first = std::fs::read(&bytes).expect("bytes");
    let first = &first[..5 + usize::from(first[3])];
    let frozen = folder.path().join("frozen.bin");
    std::fs::write(&frozen, first.repeat(1000)).expect("written");
    let frozen = frozen.display().to_string();
    let said = refused(&[&flight, "--sensor", &frozen, "--rate", "240"], 5);
    assert!(said.contains("no estimate comes of "), "{said}");
    // The same bytes always give the same estimates.
    let again = report(&alone(&[&flight, "--sensor", &bytes, "--rate", "240"]));
    assert_eq!(again["last"], found["last"]);
    // A wrong rate and a wrong protocol are named; an existing log is not replaced.
    let message = refused(&[&flight, "--sensor", &bytes, "--rate", "200"], 5);
    assert!(
        message.contains("sends 240.0 samples a second"),
        "{message}"
    );
    let wrong = [&flight, "--sensor", &bytes, "--protocol", "bno08x-rvc"];
    let message = refused(&wrong, 2);
    assert!(message.contains("found no sample"), "{message}");
    refused(&[&[flight.as_str()][..], &flown("240")].concat(), 2);
    let message = refused(&[&flight, "--virtual", "--latency", "0.2"], 2);
    assert!(message.contains("--sensor"), "{message}");
}

#[test]
fn a_sensor_on_the_ground_is_no_flight() {
    let Some(data) = shared("data/xbus") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, _] = sensed(folder.path());
    let recordings = [
        "markvilar-xsensmti-py/20260503_204234_xsensmti_with_gnss_recording.bin",
        "einride-xsens-go/1/output.bin",
        "einride-xsens-go/3/output.bin",
        "einride-xsens-go/5/output.bin",
    ];
    for name in recordings {
        let bytes = data.join(name).display().to_string();
        let output = alone(&[&flight, "--sensor", &bytes]);
        assert_eq!(output.status.code(), Some(5), "{name}");
        let found: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        // Packets of the receiver alone are counted too, and are not missing samples.
        assert_eq!(found["missing"], 0, "{name}: {found}");
        assert!(found["used"].as_u64() > Some(90), "{name}: {found}");
    }
}

#[test]
fn power_and_a_sensor_are_all_that_a_unit_needs() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, bytes] = sensed(folder.path());
    let flash = folder.path().join("flash").display().to_string();
    let stored = bodyflight()
        .args([
            "unit",
            "configure",
            &flight,
            "--rate",
            "240",
            "--flash",
            &flash,
        ])
        .output()
        .expect("the binary starts");
    assert!(stored.status.success(), "{}", text(&stored.stderr));
    let unit = Unit::start_with(&["--flash", &flash, "--sensor", &bytes]);
    std::thread::sleep(Duration::from_secs(8));
    // The power is cut; nobody had greeted the unit.
    drop(unit);
    let unit = Unit::start_with(&["--flash", &flash]);
    let out = folder.path().join("log").display().to_string();
    let read = log(&unit, &["--out", &out]);
    assert_eq!(read["damaged"], 0);
    let flights = read["flights"].as_array().expect("flights");
    assert_eq!(flights.len(), 1, "{read}");
    let seconds = flights[0]["duration_s"].as_f64().expect("a number");
    assert!((5.0..9.0).contains(&seconds), "{seconds} s");
    let estimates = flights[0]["estimates"].as_f64().expect("a number");
    assert!(estimates / seconds > 55.0, "{estimates}");
}
