//! Loads given by a description, in the real binary: hidden, simulated and estimated.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

const LOADS: &str = "[[effect]]\nmoment_nm = 20.0\nalong = \"dorsal\"\n\
    times = [{ factor = \"sine\", frequency_hz = 2.0, phase_rad = 0.5 }]\n\
    [[effect]]\nforce_n = 60.0\nat = \"l_foot\"\nalong = \"stream\"\n\
    times = [{ factor = \"speed-squared\", reference_mps = 50.0 }, { factor = \"pulse\", start_s = 1.0, duration_s = 1.0 }]\n";

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

fn json(arguments: &[&str]) -> Value {
    let output = run(&[arguments, &["--json"]].concat());
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

fn path(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().expect("plain").to_owned()
}

#[test]
fn loads_are_hidden_simulated_and_estimated() {
    let folder = tempfile::tempdir().expect("a folder");
    let [model, lab] = ["model.toml", "lab"].map(|name| path(folder.path(), name));
    std::fs::write(&model, LOADS).expect("a file");
    let quiet = ["--noise", "0", "--duration", "4", "--flights", "1"];
    let hide = ["hide", "--model", &model, "--out", &lab];
    json(&[&hide[..], &quiet].concat());
    let [flight, truth] = ["lab/flight-0", "lab/truth.toml"].map(|name| path(folder.path(), name));
    let gap = |arguments: &[&str], channel: &str| {
        json(arguments)["rms"][channel].as_f64().expect("a number")
    };
    for channel in ["angular_velocity_radps", "vertical_velocity_mps"] {
        let without = gap(&["simulate", &flight], channel);
        let with = gap(&["simulate", &flight, "--model", &truth], channel);
        assert!(with < 0.1 * without, "{channel}: {without} to {with}");
    }
    let surprise = |arguments: &[&str]| json(arguments)["nis_mean"].as_f64().expect("a number");
    let without = surprise(&["estimate", &flight]);
    let with = surprise(&["estimate", &flight, "--model", &truth]);
    assert!(with < 0.8 * without, "{without} to {with}");
}

#[test]
fn a_load_in_other_units_is_refused_with_its_place() {
    let folder = tempfile::tempdir().expect("a folder");
    let [model, lab] = ["model.toml", "lab"].map(|name| path(folder.path(), name));
    let wrong = LOADS.replace("frequency_hz", "frequency_radps");
    std::fs::write(&model, wrong).expect("a file");
    let output = run(&["hide", "--model", &model, "--out", &lab]);
    assert_eq!(output.status.code(), Some(2));
    let errors = String::from_utf8_lossy(&output.stderr);
    for part in ["model.toml", "effect 1", "frequency_radps", "frequency_hz"] {
        assert!(errors.contains(part), "{part}: {errors}");
    }
    assert!(!Path::new(&lab).exists());
}
