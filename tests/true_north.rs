//! North stays north from file to report: a flight of the independent simulator in a known wind.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::{Path, PathBuf};

use bodyflight_shared_data::{shared, skipped};
use std::process::Command;

use serde_json::Value;

const FLIGHT: &str = "wind-slow-104/flight-0";
const RECORDING: &str = "flight.mvnx";

/// Unpacks the flight into `folder`; `None`, with a visible notice, if it or `xz` is absent.
fn unpacked(folder: &Path) -> Option<PathBuf> {
    let source = shared(&format!("flights/{FLIGHT}"))?;
    let packed = source.join(format!("{RECORDING}.xz"));
    let Ok(xz) = Command::new("xz").arg("-dc").arg(&packed).output() else {
        skipped("xz is not installed");
        return None;
    };
    assert!(xz.status.success(), "{} is damaged", packed.display());
    std::fs::write(folder.join(RECORDING), xz.stdout).expect("written");
    for name in ["flight.toml", "subject.toml", "segments.json", "truth.json"] {
        std::fs::copy(source.join(name), folder.join(name)).expect("copied");
    }
    Some(folder.join("flight.toml"))
}

fn json(arguments: &[&Path]) -> Value {
    let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .arg("--json")
        .output()
        .expect("the binary starts");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {errors}");
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

/// The true wind, north and west (m/s).
fn truth(folder: &Path) -> [f64; 2] {
    let text = std::fs::read_to_string(folder.join("truth.json")).expect("the truth");
    let truth: Value = serde_json::from_str(&text).expect("JSON");
    [0, 1].map(|axis| truth["wind"][axis].as_f64().expect("a number"))
}

/// Gap of the horizontal velocity (m/s) with a model that has this wind.
fn gap_in(folder: &Path, flight: &Path, [north, west]: [f64; 2]) -> f64 {
    let model = folder.join("model.toml");
    let text =
        format!("[[effect]]\nname = \"wind\"\nnorth_mps = {north:.3}\nwest_mps = {west:.3}\n");
    std::fs::write(&model, text).expect("written");
    let report = json(&["simulate".as_ref(), flight, "--model".as_ref(), &model]);
    report["rms"]["horizontal_velocity_mps"]
        .as_f64()
        .expect("a number")
}

#[test]
fn a_flight_fits_in_the_wind_that_blew_and_in_no_other_direction() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(flight) = unpacked(folder.path()) else {
        return;
    };
    let [north, west] = truth(folder.path());
    let right = gap_in(folder.path(), &flight, [north, west]);
    for wrong in [[west, -north], [-west, north], [-north, -west], [0.0, 0.0]] {
        let gap = gap_in(folder.path(), &flight, wrong);
        println!("{right:.2} m/s in the wind that blew, {gap:.2} m/s in {wrong:.1?}");
        assert!(right < 0.8 * gap, "{wrong:?}");
    }
}

/// The wind may also be named as a velocity that the recording misses, which has the opposite sign.
#[test]
fn discover_names_the_direction_of_the_wind() {
    let folder = tempfile::tempdir().expect("a folder");
    let Some(flight) = unpacked(folder.path()) else {
        return;
    };
    let report = json(&["discover".as_ref(), &flight]);
    let found = &report["effects"][0];
    let sign = match found["name"].as_str() {
        Some("wind") => 1.0,
        Some("exit-speed") => -1.0,
        other => panic!("{other:?} is not a wind: {report}"),
    };
    let names = ["north_mps", "west_mps"];
    let found = names.map(|name| sign * found["parameters"][name].as_f64().expect("a number"));
    for (found, expected) in found.into_iter().zip(truth(folder.path())) {
        assert!(
            (found - expected).abs() < 1.0,
            "{found} m/s, {expected} blew"
        );
    }
}
