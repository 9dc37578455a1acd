//! The real binary, from arguments to files and exit codes.
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
fn demo_prints_the_table_and_writes_the_plot() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("demo");
    let output = bodyflight(&["demo", "--out", out.to_str().expect("plain")]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let table = text(&output.stdout);
    for channel in [
        "roll",
        "pitch",
        "heading",
        "yaw rate",
        "horizontal velocity",
        "vertical velocity",
    ] {
        assert!(table.contains(channel), "{table}");
    }
    let plot = std::fs::read_to_string(out.join("run.svg")).expect("the plot");
    assert!(plot.starts_with("<svg") && plot.matches("<polyline").count() > 14);
    let rows = std::fs::read_to_string(out.join("run.csv")).expect("the run");
    assert_eq!(rows.lines().count(), 7201);
}

#[test]
fn a_synthetic_flight_is_reconstructed_to_the_noise() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("rotations", folder.path(), &["--seed", "3"]);
    let report = json(&["simulate", &flight]);
    let rms = |channel: &str| report["rms"][channel].as_f64().expect(channel);
    let amplitude = |channel: &str| report["amplitude"][channel].as_f64().expect(channel);
    // The paper's noise is 0.01 rad in attitude, 0.03 rad/s about each axis, and 0.1 and 1 m/s in velocity.
    assert!(
        rms("roll_rad") < 0.02 && rms("pitch_rad") < 0.02,
        "{report}"
    );
    assert!(rms("yaw_rate_radps") < 0.06, "{report}");
    assert!(
        rms("horizontal_velocity_mps") < 0.2 && rms("vertical_velocity_mps") < 1.2,
        "{report}"
    );
    assert!(
        (2.0..7.0).contains(&amplitude("yaw_rate_radps")),
        "turns: {report}"
    );
    assert!(
        (42.0..62.0).contains(&amplitude("vertical_velocity_mps")),
        "{report}"
    );
    assert_eq!(report["frames"], 7200);
    assert!((report["duration_s"].as_f64().expect("a number") - 30.0).abs() < 1e-9);
    assert!(report["steps_per_second"].as_f64().expect("a number") > 240.0);
    // Single precision, which the unit uses, gives the same flight.
    let single = json(&["simulate", &flight, "--precision", "single"]);
    let difference = single["rms"]["heading_rad"].as_f64().expect("a number") - rms("heading_rad");
    assert!(difference.abs() < 5e-3, "{difference}");
}

#[test]
fn an_effect_of_the_model_opens_a_gap_where_the_flight_has_none() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("neutral-fall", folder.path(), &["--seed", "5"]);
    let model = folder.path().join("model.toml");
    let name = model.to_str().expect("a path");
    let plain = json(&["simulate", &flight]);
    let with = |text: &str| {
        std::fs::write(&model, text).expect("a file");
        json(&["simulate", &flight, "--model", name])
    };
    assert_eq!(
        with("[[effect]]\nname = \"wind\"\nnorth_mps = 0")["rms"],
        plain["rms"]
    );
    let windy = with("[[effect]]\nname = \"wind\"\nnorth_mps = 5");
    let gap = |report: &Value| report["rms"]["horizontal_velocity_mps"].as_f64();
    assert!(gap(&windy) > Some(2.0), "{windy}");
    assert!(gap(&plain) < Some(0.2), "{plain}");
    let message = fails(&["simulate", &flight, "--model", &flight], 2);
    assert!(message.contains("flight.toml"), "{message}");
}

#[test]
fn perfect_sensors_leave_no_gap() {
    let folder = tempfile::tempdir().expect("a folder");
    for maneuver in ["vertical", "transitions"] {
        let flight = synth(maneuver, &folder.path().join(maneuver), &["--noise", "0"]);
        let report = json(&["simulate", &flight]);
        let rms = |channel: &str| report["rms"][channel].as_f64().expect(channel);
        // The remaining error comes from the six decimals of the file; it grows with the rotation rates of flips.
        let largest = report["amplitude"]["angular_velocity_radps"].as_f64();
        let bound = 0.02_f64.max(0.0025 * largest.expect("an amplitude"));
        assert!(
            rms("angular_velocity_radps") < bound,
            "{maneuver}: {report}"
        );
        assert!(rms("vertical_velocity_mps") < 0.02, "{maneuver}: {report}");
    }
}

#[test]
fn inspect_describes_a_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    synth("neutral-fall", folder.path(), &[]);
    let file = folder.path().join("flight.mvnx");
    let report = json(&["inspect", file.to_str().expect("plain")]);
    assert_eq!(report["format"], "mvnx");
    assert_eq!(report["frames"], 7201);
    assert_eq!(report["segments"], 23);
    assert_eq!(report["arm_frame"], "t-pose");
    assert!((report["frame_rate_hz"].as_f64().expect("a number") - 240.0).abs() < 1e-9);
    assert!(report["closure_error_m"].as_f64().expect("a number") < 0.002);
    assert!(
        report["fields"]
            .as_array()
            .expect("a list")
            .contains(&Value::from("angularVelocity"))
    );
    assert!(report["version"].is_string() || report["version"].is_number());
}

#[test]
fn trim_is_a_plausible_belly_fall() {
    let report = json(&["trim"]);
    let number = |key: &str| report[key].as_f64().expect(key);
    assert!(
        (42.0..62.0).contains(&number("terminal_speed_mps")),
        "{report}"
    );
    assert!(
        (80.0..105.0).contains(&number("body_pitch_deg")),
        "{report}"
    );
    assert!((10.0..110.0).contains(&number("knee_deg")), "{report}");
}

#[test]
fn estimated_inputs_reconstruct_what_constant_ones_cannot() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("transitions", folder.path(), &["--seed", "1"]);
    let path = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let (csv, svg) = (path("est.csv"), path("est.svg"));
    let common = ["estimate", &flight, "--out", &csv, "--plot", &svg];
    let report = json(&common);
    for field in [
        "rms",
        "rms_constant",
        "updates",
        "nis_mean",
        "flags",
        "filter_s",
    ] {
        assert!(!report[field].is_null(), "{field}: {report}");
    }
    let gap = |side: &str, channel: &str| report[side][channel].as_f64().expect(channel);
    for channel in ["roll_rad", "pitch_rad"] {
        let (with, without) = (gap("rms", channel), gap("rms_constant", channel));
        assert!(
            with < 0.15 && 3.0 * with < without,
            "{channel}: {with} with, {without} without"
        );
    }
    assert_eq!(report["flags"]["update"], 0);
    let svg = std::fs::read_to_string(svg).expect("the plot");
    assert!(svg.contains("muscle input coefficients") && svg.contains("without"));
    // The estimate can be used like any other input history.
    let text = std::fs::read_to_string(&flight).expect("the flight");
    std::fs::write(&flight, text.replace("inputs.csv", "est.csv")).expect("written");
    let again = json(&["simulate", &flight]);
    assert_eq!(again["frames"], 7200);
}

#[test]
fn tuning_recovers_the_truth_and_is_repeatable() {
    let folder = tempfile::tempdir().expect("a folder");
    let used = synth("rotations", &folder.path().join("a"), &["--seed", "1"]);
    let held_out = synth("vertical", &folder.path().join("b"), &["--seed", "2"]);
    // GIVEN a wrong guess
    let subject = folder.path().join("a/subject.toml");
    let right = std::fs::read_to_string(&subject).expect("the subject");
    std::fs::write(&subject, right.replace("cd = 1.2", "cd = 1.5")).expect("written");
    let other = folder.path().join("b/subject.toml");
    std::fs::copy(&subject, other).expect("copied");
    // WHEN it is tuned twice with the same seed
    let arguments = [
        "tune",
        &used,
        "--hold-out",
        &held_out,
        "--draws",
        "24",
        "--seed",
        "7",
    ];
    let (first, second) = (json(&arguments), json(&arguments));
    // THEN both results are equal, better, and better on the held-out flight
    assert_eq!(first, second);
    let better =
        |before: &Value, after: &Value| after.as_f64().expect("n") < before.as_f64().expect("n");
    assert!(
        better(&first["score_before"], &first["score_after"]),
        "{first}"
    );
    let check = &first["held_out"][0];
    assert!(
        better(&check["score_before"], &check["score_after"]),
        "{first}"
    );
}

#[test]
fn problems_name_file_place_and_next_step() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let write = |name: &str, content: &str| {
        std::fs::write(folder.path().join(name), content).expect("written");
        path(name)
    };
    let missing = fails(&["simulate", &path("nowhere.toml")], 3);
    assert!(
        missing.contains("nowhere.toml") && missing.contains("No such file"),
        "{missing}"
    );
    let empty = fails(&["inspect", &write("empty.mvnx", "")], 2);
    assert!(empty.contains("empty.mvnx"), "{empty}");
    let wrong = write(
        "flight.toml",
        "recording = \"a.mvnx\"\n[air]\ndensity = -1\n",
    );
    let message = fails(&["simulate", &wrong], 2);
    assert!(
        message.contains("air.density") && message.contains("-1"),
        "{message}"
    );
    let subject = write(
        "subject.toml",
        "height_m = 1.8\nmass_kg = -5\nsex = \"male\"\n",
    );
    let message = fails(&["trim", &subject], 2);
    assert!(
        message.contains("subject.toml:2") && message.contains("mass_kg"),
        "{message}"
    );
    let message = fails(&["synth", "moonwalk", "--out", &path("x")], 2);
    assert!(
        message.contains("moonwalk") && message.contains("rotations"),
        "{message}"
    );
    assert!(
        !folder.path().join("x").exists(),
        "nothing is left of a refused request"
    );
    assert_eq!(bodyflight(&["simulate"]).status.code(), Some(2));
}

#[test]
fn an_input_is_never_overwritten() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("neutral-fall", folder.path(), &[]);
    let before = std::fs::read(&flight).expect("the flight");
    let message = fails(&["simulate", &flight, "--out", &flight], 2);
    assert!(message.contains("overwritten"), "{message}");
    assert_eq!(std::fs::read(&flight).expect("the flight"), before);
}

#[test]
fn every_verb_explains_itself_with_an_example() {
    let help = text(&bodyflight(&["--help"]).stdout);
    assert!(help.contains("Exit codes"));
    let verbs = help
        .split("Commands:")
        .nth(1)
        .expect("verbs")
        .split("Options:")
        .next()
        .expect("verbs");
    let mut count = 0;
    for verb in verbs
        .lines()
        .filter_map(|line| line.split_whitespace().next())
    {
        if verb == "help" || !verbs.contains(&format!("\n  {verb} ")) {
            continue;
        }
        count += 1;
        let help = text(&bodyflight(&[verb, "--help"]).stdout);
        assert!(help.contains("bodyflight"), "{verb}: {help}");
    }
    assert!(count >= 6, "{verbs}");
}

#[test]
fn figures_are_written_and_bad_input_of_the_viewer_is_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = synth("rotations", folder.path(), &[]);
    let out = folder.path().join("figures");
    let out = out.to_str().expect("a plain path");
    let report = json(&["figures", &flight, "--from", "2", "--to", "6", "--out", out]);
    let figures = report["figures"].as_array().expect("a list");
    assert_eq!(figures.len(), 4);
    for figure in figures {
        let svg = std::fs::read_to_string(figure.as_str().expect("a path")).expect("a file");
        assert!(svg.contains("</svg>") && !svg.contains("NaN"), "{figure}");
    }
    let estimate = ["--preset", "turning"];
    let said = fails(&[&["estimate", &flight][..], &estimate].concat(), 5);
    // What the estimate doubts, its figures doubt too.
    let other = ["--out", out, "--force"];
    let message = fails(&[&["figures", &flight][..], &estimate, &other].concat(), 5);
    let (doubt, _) = said.split_once(" help:").expect("a reason and a help");
    assert!(message.contains(doubt), "{message}\n{said}");
    let svg = std::fs::read_to_string(folder.path().join("figures/inputs.svg")).expect("a file");
    assert!(svg.contains("(doubtful)"));
    // The times without trust are shaded, and only in doubtful flights.
    assert!(svg.contains("\ndoubtful\n") || svg.contains("\nlost\n"));
    // Several flights share their axes, and each has its own colour and bars.
    let both = folder.path().join("both");
    let both = both.to_str().expect("a plain path");
    let report = json(&["figures", &flight, &flight, "--to", "2", "--out", both]);
    let figures = report["figures"].as_array().expect("a list");
    assert_eq!(figures.len(), 5, "{report}");
    let drawn = |name: &str| {
        let path = Path::new(both).join(name);
        std::fs::read_to_string(path).expect("a figure")
    };
    let inputs = drawn("inputs.svg");
    assert_eq!(inputs.matches("<polygon").count(), 12);
    for legend in ["\nA\n", "\nB\n", "damping, roll"] {
        assert!(inputs.contains(legend), "{legend}");
    }
    assert!(drawn("reconstruction.svg").contains("B measured"));
    drawn("snapshots-B.svg");
    let many = [&["figures"][..], &[flight.as_str(); 6]].concat();
    let message = fails(&many, 2);
    assert!(
        message.contains("expected 1 to 5 flights in a figure, found 6"),
        "{message}"
    );
    let message = fails(
        &["figures", &flight, "--from", "500", "--out", out, "--force"],
        2,
    );
    assert!(message.contains("between --from and --to"), "{message}");
    let message = fails(&["figures", &flight, "--snapshots", "0"], 2);
    assert!(
        message.contains("expected 1 to 40 snapshots in a row, found 0"),
        "{message}"
    );
    let message = fails(&["view", &flight, "--out", &flight], 2);
    assert!(message.contains("would be overwritten"), "{message}");
    let message = fails(&["view", "absent/flight.toml"], 3);
    assert!(message.contains("absent/flight.toml"), "{message}");
    let message = fails(&["view", &flight, "--discovery", &flight], 2);
    assert!(
        message.contains("this is a flight.toml, not JSON"),
        "{message}"
    );
    let message = fails(&["fly", "--density", "9"], 2);
    assert!(message.contains("0.1 to 2 kg/m3"), "{message}");
}
