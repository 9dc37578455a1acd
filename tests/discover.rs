//! Hiding and discovering with the real binary.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;
use std::process::Command;

use serde_json::Value;

fn json(arguments: &[&str]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .arg("--json")
        .output()
        .expect("the binary starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

/// Two flights with something hidden; their `flight.toml`.
fn hide(effect: &str, seconds: &str, folder: &Path) -> [String; 2] {
    let out = folder.to_str().expect("a plain path");
    let written = json(&[
        "hide",
        effect,
        "--out",
        out,
        "--duration",
        seconds,
        "--seed",
        "2",
    ]);
    [0, 1].map(|k| written["flights"][k].as_str().expect("a path").to_owned())
}

#[test]
fn a_hidden_effect_is_named_and_closes_the_gap_of_another_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("gyro-bias", "15", &folder.path().join("lab"));
    let out = folder.path().join("found");
    let out = out.to_str().expect("a plain path");
    let report = json(&["discover", &flight, "--hold-out", &other, "--out", out]);
    assert_eq!(report["verdict"], "named", "{report}");
    assert_eq!(report["effects"][0]["name"], "gyro-bias");
    assert_eq!(report["effects"].as_array().map(Vec::len), Some(1));
    let truth = std::fs::read_to_string(folder.path().join("lab/truth.toml")).expect("the truth");
    for name in &["x_rad_s", "y_rad_s", "z_rad_s"] {
        let line = truth
            .lines()
            .find(|line| line.starts_with(name))
            .expect("a parameter");
        let hidden: f64 = line
            .split('=')
            .next_back()
            .expect("a value")
            .trim()
            .parse()
            .expect("a number");
        let found = report["effects"][0]["parameters"][*name]
            .as_f64()
            .expect("a number");
        assert!(
            (found - hidden).abs() < 0.005,
            "{name}: hidden {hidden}, found {found}"
        );
    }
    let held_out = &report["held_out"][0];
    let misfit = |key: &str| held_out[key].as_f64().expect("a number");
    assert!(misfit("misfit_after") < 0.05 * misfit("misfit_before"));

    // The free run takes the model that was written.
    let model = folder.path().join("found/model.toml");
    let model = model.to_str().expect("a plain path");
    let gap = |arguments: &[&str]| {
        json(arguments)["rms"]["angular_velocity_radps"]
            .as_f64()
            .expect("a number")
    };
    let before = gap(&["simulate", &other]);
    let after = gap(&["simulate", &other, "--model", model]);
    assert!(after < before, "{before} to {after}");

    // A filter finds no errors of sensors, so it does not take this one; a wind it takes.
    let refused = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["estimate", &other, "--model", model])
        .output()
        .expect("the binary starts");
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("sensors"));
    let wind = folder.path().join("wind.toml");
    std::fs::write(&wind, "[[effect]]\nname = \"wind\"\nnorth_mps = 3.0\n").expect("a file");
    json(&["estimate", &other, "--model", wind.to_str().expect("plain")]);
    let figure = std::fs::read_to_string(folder.path().join("found/report.svg")).expect("a figure");
    assert!(figure.contains("with the effects found"));
}

#[test]
fn nothing_is_named_where_nothing_is_hidden_or_the_flight_is_short() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("clean", "15", &folder.path().join("clean"));
    let report = json(&["discover", &flight, "--hold-out", &other]);
    assert_eq!(report["verdict"], "none", "{report}");
    assert_eq!(report["model"].as_array().map(Vec::len), Some(0));

    let [short, _] = hide("wind", "5", &folder.path().join("short"));
    let report = json(&["discover", &short]);
    assert_eq!(report["verdict"], "thin", "{report}");
    assert_eq!(report["model"].as_array().map(Vec::len), Some(0));
}

#[test]
fn what_is_not_in_the_library_is_not_given_a_name() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("outside-flapping", "15", &folder.path().join("lab"));
    let report = json(&["discover", &flight, "--hold-out", &other]);
    assert_eq!(report["verdict"], "unexplained", "{report}");
}
