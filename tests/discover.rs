//! Hides and discovers effects with the real binary.
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

/// Makes two flights with a hidden effect; returns their `flight.toml`.
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
    for name in &["x_radps", "y_radps", "z_radps"] {
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
    // An error of the sensor changes the file, not the flight.
    assert_eq!(report["changes"].as_array().map(Vec::len), Some(0));
    let closed = report["held_out"][0]["gap"]["closed_share"].as_f64();
    assert!(closed.expect("a number") > 0.9, "{report}");

    // The free run accepts the written model, and its gap shrinks, since nothing else is wrong.
    let exact = folder.path().join("exact");
    let exact = exact.to_str().expect("a plain path");
    let exact = [
        "hide",
        "gyro-bias",
        "--seed",
        "2",
        "--noise",
        "0",
        "--out",
        exact,
    ];
    let written = json(&[&exact[..], &["--duration", "2"]].concat());
    let short = written["flights"][0].as_str().expect("a path");
    let model = folder.path().join("found/model.toml");
    let model = model.to_str().expect("a plain path");
    let gap = |arguments: &[&str]| {
        json(arguments)["rms"]["angular_velocity_radps"]
            .as_f64()
            .expect("a number")
    };
    let before = gap(&["simulate", short]);
    let after = gap(&["simulate", short, "--model", model]);
    assert!(after < 0.5 * before, "{before} to {after}");

    // The filter accepts it too; with another model it reports that it cannot be trusted.
    json(&["estimate", &other, "--model", model]);
    let wind = folder.path().join("wind.toml");
    std::fs::write(&wind, "[[effect]]\nname = \"wind\"\nnorth_mps = 3.0\n").expect("a file");
    let doubted = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["estimate", &other, "--model", wind.to_str().expect("plain")])
        .output()
        .expect("the binary starts");
    assert_eq!(doubted.status.code(), Some(5));
    assert!(String::from_utf8_lossy(&doubted.stderr).contains("the model lacks an effect"));
    let figure = std::fs::read_to_string(folder.path().join("found/report.svg")).expect("a figure");
    assert!(figure.contains("with the effects found"));
}

#[test]
fn what_an_effect_changes_for_the_person_is_said() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, _] = hide("mass", "13", &folder.path().join("lab"));
    let truth = std::fs::read_to_string(folder.path().join("lab/truth.toml")).expect("the truth");
    let (_, factor) = truth.split_once("factor = ").expect("a factor");
    let is_heavier = factor.trim().parse::<f64>().expect("a number") > 1.0;
    let report = json(&["discover", &flight]);
    let first = report["changes"][0].as_str().expect("a sentence");
    assert!(first.starts_with("After 3 s you fall "), "{first}");
    assert!(first.ends_with("because of mass"), "{first}");
    let says = if is_heavier { " faster " } else { " slower " };
    assert!(first.contains(says), "{first}: {truth}");
}

#[test]
fn the_strength_of_what_is_hidden_can_be_given() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("a plain path");
    let common = [
        "hide",
        "rig",
        "--duration",
        "2",
        "--flights",
        "1",
        "--out",
        out,
    ];
    json(&[&common[..], &["--strength", "0.6"]].concat());
    let truth = std::fs::read_to_string(folder.path().join("truth.toml")).expect("the truth");
    assert!(truth.contains("mass_kg = 9.0"), "{truth}");
    let refused = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args([&common[..], &["--strength", "1.5"]].concat())
        .output()
        .expect("the binary starts");
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("--strength"));
}

#[test]
fn no_effect_is_named_if_none_is_hidden_or_the_flight_is_short() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("clean", "15", &folder.path().join("clean"));
    let report = json(&["discover", &flight, "--hold-out", &other]);
    // Joints and subject have errors typical of suits and scales, but no effect is missing from the model.
    assert_eq!(report["verdict"], "calibrated", "{report}");
    assert_eq!(report["model"].as_array().map(Vec::len), Some(0));

    let [short, _] = hide("wind", "5", &folder.path().join("short"));
    let report = json(&["discover", &short]);
    assert_eq!(report["verdict"], "thin", "{report}");
    assert_eq!(report["model"].as_array().map(Vec::len), Some(0));
}

/// Deliberate fast turns: the flight's inputs describe what the skydiver does, so nothing is missing and nothing is wrong.
#[test]
fn a_clean_flight_needs_no_change() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut flights = Vec::new();
    for (maneuver, seed) in [
        ("barrel-roll", 0),
        ("barrel-roll", 5),
        ("aggressive-turns", 5),
    ] {
        let out = folder.path().join(format!("{maneuver}-{seed}"));
        let out = out.to_str().expect("a plain path").to_owned();
        json(&[
            "synth",
            maneuver,
            "--seed",
            &seed.to_string(),
            "--out",
            &out,
        ]);
        let flight = format!("{out}/flight.toml");
        let report = json(&["discover", &flight]);
        assert_eq!(report["verdict"], "none", "{maneuver} {seed}: {report}");
        flights.push(flight);
    }
    let report = json(&["discover", &flights[0], "--hold-out", &flights[1]]);
    assert_eq!(report["verdict"], "none", "{report}");
}

/// The same evidence must not count twice, nor confirm itself, under whatever name.
#[test]
fn a_flight_that_is_given_twice_is_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("flown");
    let out = out.to_str().expect("a plain path");
    json(&["synth", "neutral-fall", "--out", out]);
    let copy = folder.path().join("copy.toml");
    let flight = format!("{out}/flight.toml");
    let packed = format!("{out}/again.mvnx.gz");
    let mvnx = std::fs::read(format!("{out}/flight.mvnx")).expect("a recording");
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    std::io::Write::write_all(&mut gzip, &mvnx).expect("memory");
    std::fs::write(&packed, gzip.finish().expect("memory")).expect("a file");
    let text = std::fs::read_to_string(&flight).expect("text");
    let text = text.replace("flight.mvnx", "flown/again.mvnx.gz");
    let text = text.replace("\"subject.toml", "\"flown/subject.toml");
    let text = text.replace("\"inputs.csv", "\"flown/inputs.csv");
    std::fs::write(&copy, text).expect("a file");
    let copy = copy.to_str().expect("a plain path");
    for (arguments, says) in [
        (&[copy][..], "their evidence would count twice"),
        (
            &["--hold-out", copy],
            "this flight is held out, but effects are also fitted to it",
        ),
    ] {
        let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["discover", &flight])
            .args(arguments)
            .output()
            .expect("the binary starts");
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.replace("\n ", "").contains(says), "{errors}");
    }
}

#[cfg(unix)]
#[test]
fn ctrl_c_ends_a_search_within_a_second() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("wind", "60", folder.path());
    let mut search = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["discover", &flight, "--hold-out", &other])
        .stdout(std::process::Stdio::null())
        .spawn()
        .expect("the binary starts");
    std::thread::sleep(std::time::Duration::from_secs(3));
    let running = search.try_wait().expect("a state");
    assert!(running.is_none(), "the search was over before Ctrl-C");
    let pressed = std::time::Instant::now();
    let process = search.id().to_string();
    let sent = Command::new("kill").args(["-INT", &process]).status();
    assert!(sent.expect("kill is there").success());
    let ended = search.wait().expect("it ends");
    let seconds = pressed.elapsed().as_secs_f64();
    assert_eq!(ended.code(), Some(130));
    assert!(seconds < 1.5, "{seconds} s");
}

#[test]
fn loads_outside_the_library_are_described_and_not_named() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("outside-flapping", "15", &folder.path().join("lab"));
    let out = folder.path().join("found");
    let out = out.to_str().expect("a plain path");
    let report = json(&["discover", &flight, "--hold-out", &other, "--out", out]);
    assert_eq!(report["verdict"], "described", "{report}");
    assert_eq!(report["effects"].as_array().map(Vec::len), Some(0));
    // The hidden load is 25 N m about the cranial axis, four times a second.
    let first = &report["description"]["loads"][0];
    let words = first["in_words"].as_str().expect("words");
    assert!(words.starts_with("moment about cranial"), "{words}");
    assert!(words.contains("4.0"), "{words}");
    let size = first["size"].as_f64().expect("a number").abs();
    assert!((20.0..30.0).contains(&size), "{size}");
    let closed = report["held_out"][0]["gap"]["closed_share"].as_f64();
    assert!(closed.expect("a number") > 0.7, "{report}");

    // The free run accepts the written loads.
    let model = folder.path().join("found/model.toml");
    let text = std::fs::read_to_string(&model).expect("a model");
    assert!(text.contains("moment_nm") && text.contains("frequency_hz"));
    json(&[
        "simulate",
        &other,
        "--model",
        model.to_str().expect("plain"),
    ]);
}

#[test]
fn the_track_of_a_point_is_refused_with_the_verb_that_analyses_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let track = folder.path().join("TRACK.CSV");
    std::fs::write(&track, "time_s,height_m\n0,4000\n1,3995\n").expect("a file");
    let track = track.to_str().expect("plain");
    let [flight, _] = hide("wind", "7", &folder.path().join("lab"));
    for flights in [&[track][..], &[&flight, "--hold-out", track]] {
        let refused = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .arg("discover")
            .args(flights)
            .output()
            .expect("the binary starts");
        assert_eq!(refused.status.code(), Some(2));
        let said = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(said.contains(&format!("bodyflight fall {track}")), "{said}");
    }
}

/// Only the strength of turbulence is known: each flight has its own path, and a model uses the mean.
#[test]
fn random_effects_are_hidden_with_their_strength_and_simulated_with_their_mean() {
    let folder = tempfile::tempdir().expect("a folder");
    let [flight, other] = hide("turbulence", "6", &folder.path().join("lab"));
    let truth = folder.path().join("lab/truth.toml");
    let text = std::fs::read_to_string(&truth).expect("the truth");
    assert!(
        text.contains("name = \"turbulence\"") && text.contains("gust_mps = "),
        "{text}"
    );
    let simulate = |flight: &str, more: &[&str]| {
        let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["simulate", flight, "--json"])
            .args(more)
            .output()
            .expect("the binary starts");
        let warnings = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{warnings}");
        let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
        (report["rms"].clone(), warnings)
    };
    let model = truth.to_str().expect("a plain path");
    let (plain, quiet) = simulate(&flight, &[]);
    let (mean, warned) = simulate(&flight, &["--model", model]);
    assert_eq!(plain, mean);
    assert!(
        !quiet.contains("turbulence") && warned.contains("turbulence"),
        "{warned}"
    );
    assert_ne!(simulate(&other, &[]).0, plain);
}
