//! Estimation by the real binary: its results for flights with known inputs, and its own assessment of them.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn json(arguments: &[&str]) -> Value {
    let output = bodyflight(&[arguments, &["--json"]].concat());
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

fn fails(arguments: &[&str], code: i32) -> String {
    let output = bodyflight(arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    // Terminal output may wrap anywhere: compare without line breaks.
    message
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect::<Vec<_>>()
        .join(" ")
}

fn synth(maneuver: &str, folder: &Path, extra: &[&str]) -> String {
    let out = folder.to_str().expect("a plain path");
    let report = json(&[&["synth", maneuver, "--out", out], extra].concat());
    report["flight"].as_str().expect("a path").to_owned()
}

#[test]
fn an_estimate_worse_than_constant_coefficients_is_flagged() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("neutral-fall", folder.path(), &["--noise", "0"]);
    let said = fails(&["estimate", &flight, "--preset", "turning"], 5);
    assert!(
        said.contains("worse than") && said.contains("--preset auto"),
        "{said}"
    );
    // The default preset does better: the flight has no muscle input, and none is estimated.
    let csv = folder.path().join("found.csv");
    let csv = csv.to_str().expect("plain");
    let report = json(&["estimate", &flight, "--out", csv]);
    let vertical = report["rms"]["vertical_velocity_mps"]
        .as_f64()
        .expect("a number");
    assert!(vertical < 0.005, "{vertical}");
    for line in std::fs::read_to_string(csv)
        .expect("the table")
        .lines()
        .skip(1)
    {
        let inputs = line.split(',').skip(1).take(3);
        for input in inputs.map(|field| field.parse::<f64>().expect("a number")) {
            // What the digits of the file leave: its joints are exact, so nothing else takes it up.
            assert!(input.abs() < 0.02, "{line}");
        }
    }
}

/// Checks that a report says how large the joint errors are (deg), within three of the deviations that it states.
fn assert_joint_errors(report: &Value, degrees: f64) {
    assert_eq!(report["joint_error_source"], "seen", "{report}");
    let number = |name: &str| report[name].as_f64().expect("a number");
    let (found, deviation) = (number("joint_error_deg"), number("joint_error_sd_deg"));
    assert!(deviation < 0.3 * degrees + 0.1, "{found} +- {deviation}");
    let within = 3.0 * deviation + 0.05;
    assert!((found - degrees).abs() < within, "{found} +- {deviation}");
}

/// Splits `text` into the parts before, between and after two markers, which stay with the outer parts.
fn cut<'a>(text: &'a str, from: &str, to: &str) -> Option<(&'a str, &'a str, &'a str)> {
    let begin = text.find(from)? + from.len();
    let end = begin + text[begin..].find(to)?;
    Some((&text[..begin], &text[begin..end], &text[end..]))
}

#[test]
fn frozen_sensors_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("neutral-fall", folder.path(), &["--seed", "3"]);
    let recording = folder.path().join("flight.mvnx");
    let text = std::fs::read_to_string(&recording).expect("the recording");
    // From 10 s to 15 s the pelvis, or everything recorded, repeats the same values.
    let frames: Vec<&str> = text.split_inclusive("</frame>").collect();
    let held: Vec<Option<String>> = ["orientation", "velocity", "angularVelocity"]
        .iter()
        .map(|name| {
            let inside = cut(frames[2400], &format!("<{name}>"), &format!("</{name}>"));
            inside.map(|(_, inside, _)| inside.to_owned())
        })
        .collect();
    let mut frozen = String::new();
    for (index, frame) in frames.iter().enumerate() {
        let mut frame = (*frame).to_owned();
        for (name, held) in ["orientation", "velocity", "angularVelocity"]
            .iter()
            .zip(&held)
        {
            let (Some(held), true) = (held, (2400..3600).contains(&index)) else {
                continue;
            };
            let found = cut(&frame, &format!("<{name}>"), &format!("</{name}>"));
            let (before, _, after) = found.expect("the same elements in each frame");
            frame = [before, held, after].concat();
        }
        frozen.push_str(&frame);
    }
    assert_ne!(frozen, text);
    std::fs::write(&recording, frozen).expect("written");
    let csv = folder.path().join("found.csv");
    let out = csv.to_str().expect("plain");
    fails(&["estimate", &flight, "--out", out], 5);
    let table = std::fs::read_to_string(csv).expect("the table");
    let (mut flagged, mut after) = (0, 0);
    let mut lines = table.lines();
    let mut names = lines.next().expect("a header").split(',');
    let column = names.position(|name| name == "consistency");
    let column = column.expect("a column of trust");
    for line in lines {
        let fields: Vec<&str> = line.split(',').collect();
        let time: f64 = fields[0].parse().expect("a time");
        let consistent = fields[column] == "consistent";
        flagged += usize::from(!consistent && (10.5..15.0).contains(&time));
        after += usize::from(consistent && time > 20.0);
    }
    assert!(flagged > 260, "{flagged} of 270");
    assert!(after > 500, "{after} of 600");
}

#[test]
fn a_plot_shows_what_the_filter_watches() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("layouts", folder.path(), &[]);
    let plot = folder.path().join("estimate.svg");
    let report = json(&["estimate", &flight, "--plot", plot.to_str().expect("plain")]);
    assert_joint_errors(&report, 0.0);
    let svg = std::fs::read_to_string(plot).expect("the plot");
    for label in [
        "angular velocity",
        "residual load",
        "lost above",
        "roll (degrees)",
        "yaw rate, positive to the left (degrees/s)",
        "consistent ",
        "deg seen",
    ] {
        assert!(svg.contains(label), "{label}");
    }
}

#[test]
fn a_smoothed_estimate_flies_the_flight_again() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth(
        "tracking",
        folder.path(),
        &["--seed", "3", "--joint-error-deg", "2"],
    );
    let csv = folder.path().join("found.csv");
    let csv = csv.to_str().expect("plain");
    let common = ["estimate", &flight, "--force", "--out", csv];
    let (forward, whole) = (
        json(&common),
        json(&[&common[..], &["--method", "smooth"]].concat()),
    );
    for report in [&forward, &whole] {
        assert!(report["doubt"].is_null(), "{report}");
        assert_joint_errors(report, 2.0);
        let nis = report["nis_mean"].as_f64().expect("a number");
        assert!((0.75..1.5).contains(&nis), "{nis}");
    }
    let text = std::fs::read_to_string(&flight).expect("the flight");
    let again = text.replace("inputs.csv", "found.csv");
    let again = again.lines().filter(|line| !line.starts_with("muscles"));
    std::fs::write(&flight, again.collect::<Vec<&str>>().join("\n")).expect("written");
    let again = json(&["simulate", &flight]);
    for (channel, most) in [
        ("roll_rad", 0.15),
        ("pitch_rad", 0.15),
        ("vertical_velocity_mps", 1.5),
    ] {
        let gap = again["rms"][channel].as_f64().expect("a number");
        assert!(gap < most, "{channel}: {gap}");
    }
}

/// Muscle input over time, from a table written by `estimate`.
fn muscle_inputs(table: &Path) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(table).expect("the table");
    text.lines()
        .skip(1)
        .map(|line| {
            let mut fields = line.split(',').skip(1);
            [(); 3].map(|()| {
                let field = fields.next().expect("an input");
                field.parse().expect("a number")
            })
        })
        .collect()
}

#[test]
fn the_whole_flight_distinguishes_joints_from_muscle_input() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut filtered, mut smoothed) = (0.0, 0.0);
    for seed in ["7", "8"] {
        let folder = folder.path().join(seed);
        let flight = synth(
            "side-slides",
            &folder,
            &["--seed", seed, "--joint-error-deg", "2"],
        );
        // The true input is zero, so the estimate is the error.
        for (method, sum) in [("filter", &mut filtered), ("smooth", &mut smoothed)] {
            let table = folder.join(format!("{method}.csv"));
            let out = table.to_str().expect("plain");
            let report = json(&["estimate", &flight, "--method", method, "--out", out]);
            assert!(report["doubt"].is_null(), "{report}");
            let inputs = muscle_inputs(&table);
            let squares = inputs.iter().flatten().map(|input| input * input);
            *sum += squares.sum::<f64>() / inputs.len() as f64;
        }
    }
    let ratio = (smoothed / filtered).sqrt();
    assert!(ratio < 0.6, "{ratio}: {smoothed} of {filtered}");
}

#[test]
fn presets_are_listed_and_read_from_files() {
    let listed = json(&["estimate", "--presets"]);
    assert_eq!(listed[0]["name"], "auto");
    assert_eq!(listed[1]["name"], "sigma-points");
    assert_eq!(listed[2]["name"], "tracking");
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("layouts", folder.path(), &[]);
    // The same filter with other derivatives: nearly the same estimate.
    let nis = |preset: &str| {
        let report = json(&["estimate", &flight, "--preset", preset]);
        report["nis_mean"].as_f64().expect("a number")
    };
    let [differences, points] = ["auto", "sigma-points"].map(nis);
    assert!(
        (points / differences - 1.0).abs() < 0.1,
        "{points} {differences}"
    );
    assert!(
        (points - differences).abs() > 0.0,
        "the preset does nothing"
    );
    let preset = folder.path().join("preset.toml");
    std::fs::write(&preset, "joint_error_deg = 0.5\n").expect("written");
    let preset = preset.to_str().expect("plain");
    let report = json(&["estimate", &flight, "--preset", preset]);
    assert_eq!(report["joint_error_deg"], 0.5);
    std::fs::write(preset, "joint_eror_deg = 0.5\n").expect("written");
    fails(&["estimate", &flight, "--preset", preset], 2);
}
