//! Discovery on flights of an independent simulator, which has its own code and its own errors of joints, sensors and
//! subject.
//!
//! The flights are not part of the repository: they are expected in `shared/flights` beside it, compressed with xz. If
//! they or the `xz` program are absent, the test reports that and ends.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

use std::path::{Path, PathBuf};

use bodyflight_shared_data::{shared, skipped};
use std::process::Command;
use std::time::Instant;

use serde_json::Value;

/// Unpacks both flights of a pair and returns their `flight.toml`; `None` without `xz`.
fn unpacked(pair: &Path, folder: &Path) -> Option<[PathBuf; 2]> {
    let flights = [0, 1].map(|k| format!("flight-{k}"));
    for flight in &flights {
        let (from, to) = (pair.join(flight), folder.join(flight));
        std::fs::create_dir_all(&to).expect("a folder");
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
    }
    Some(flights.map(|flight| folder.join(flight).join("flight.toml")))
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

/// The named effect of this name, if there is one.
fn named<'a>(report: &'a Value, name: &str) -> Option<&'a Value> {
    let named = report["effects"].as_array().expect("effects");
    named.iter().find(|effect| effect["name"] == name)
}

/// Whether the parameters of a named effect are within a number of standard errors of the truth.
fn is_near(effect: &Value, truth: &[(&str, f64)], deviations: f64) -> bool {
    truth.iter().all(|(parameter, truth)| {
        let value = number(&effect["parameters"][parameter]);
        let error = number(&effect["standard_errors"][parameter]);
        (value - truth).abs() <= deviations * error
    })
}

fn says(report: &Value, words: &[&str]) -> bool {
    let text = format!(
        "{} {} {}",
        report["effects"], report["adjustments"], report["model"]
    );
    words.iter().any(|word| text.contains(word))
}

/// Whether a report is correct by the rules that come with the flights.
fn is_right(pair: &str, report: &Value) -> bool {
    let verdict = report["verdict"].as_str().expect("a verdict");
    let only = |name: &str, truth: &[(&str, f64)]| {
        let effect = named(report, name);
        verdict == "named" && effect.is_some_and(|effect| is_near(effect, truth, 4.0))
    };
    match pair.split('-').next().expect("a family") {
        "none" => matches!(verdict, "none" | "calibrated"),
        "wind" => {
            // The truth is in the axes of the recording, from which those of the model may differ by a quarter turn.
            let near = |wind: &Value| {
                let [north, west] =
                    ["north_mps", "west_mps"].map(|name| number(&wind["parameters"][name]));
                let truth = [(-2.952, 9.337), (9.337, 2.952)];
                truth
                    .iter()
                    .any(|(x, y)| (north - x).abs() < 1.0 && (west - y).abs() < 1.0)
            };
            verdict == "named" && named(report, "wind").is_some_and(near)
        }
        "mass" => matches!(verdict, "named" | "calibrated") && says(report, &["mass", "drag"]),
        "rig" => {
            let any = ["rig-size", "drag", "trunk-shape"];
            verdict == "named" && any.iter().any(|name| named(report, name).is_some())
        }
        "legs_drag" => only("shank-drag", &[("left_factor", 1.9), ("right_factor", 1.9)]),
        "damping" => only(
            "damping",
            &[
                ("pitch_factor", 2.5),
                ("yaw_factor", 2.5),
                ("roll_factor", 2.5),
            ],
        ),
        "pitch_input" => only("muscle", &[("pitch", 0.8)]),
        "asym" => only(
            "forearm-drag",
            &[("left_factor", 2.0), ("right_factor", 1.0)],
        ),
        "updraft" => verdict == "named" && named(report, "updraft").is_some(),
        "unknown_shake" => matches!(verdict, "described" | "unexplained"),
        family => panic!("no rule for {family}"),
    }
}

#[test]
fn flights_of_another_simulator_are_judged_rightly() {
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
        let name = pair
            .file_name()
            .expect("a name")
            .to_string_lossy()
            .into_owned();
        let folder = tempfile::tempdir().expect("a folder");
        let Some([flight, other]) = unpacked(pair, folder.path()) else {
            skipped("there is no xz to unpack the flights with");
            return;
        };
        let begin = Instant::now();
        let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .arg("discover")
            .arg(&flight)
            .arg("--hold-out")
            .arg(&other)
            .arg("--json")
            .output()
            .expect("the binary starts");
        let seconds = begin.elapsed().as_secs_f64();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{name}: {errors}");
        let report: Value =
            serde_json::from_slice(&output.stdout).expect("standard output is JSON");
        let misfit = number(&report["errors"][0]["misfit"]);
        println!(
            "{name}: {} {} misfit {misfit:.2}, {seconds:.1} s",
            report["verdict"], report["model"]
        );
        // Errors absorb any effect that is still missing, so the misfit stays near one.
        assert!((0.9..1.1).contains(&misfit), "{name}: misfit {misfit}");
        if !is_right(&name, &report) {
            wrong.push(format!(
                "{name}: {} {}",
                report["verdict"], report["effects"]
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} of {} wrong:\n{}",
        wrong.len(),
        pairs.len(),
        wrong.join("\n")
    );
}
