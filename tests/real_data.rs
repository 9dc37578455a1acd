//! Real flights, and what recordings and tracks beside them may be, through the real binary.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

use std::fmt::Write;

use std::path::Path;
use std::process::{Command, Output, Stdio};

use bodyflight::formats::recording::{FlightFrame, Options, Recording};
use serde_json::Value;

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

/// Standard output as JSON, and the exit code.
fn json(arguments: &[&str]) -> (Value, Option<i32>) {
    let output = bodyflight(&[arguments, &["--json"]].concat());
    let value = serde_json::from_slice(&output.stdout);
    (
        value.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr))),
        output.status.code(),
    )
}

/// What is said where it fails, with the exit code; lines of a terminal may break anywhere.
fn fails(arguments: &[&str]) -> (String, Option<i32>) {
    let output = bodyflight(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let words = message.split_whitespace().filter(|word| *word != "│");
    (words.collect::<Vec<_>>().join(" "), output.status.code())
}

fn number(value: &Value) -> f64 {
    value
        .as_f64()
        .unwrap_or_else(|| panic!("a number: {value}"))
}

#[test]
fn somersaults_are_predicted_by_the_exact_equations_and_not_by_the_published_ones() {
    let folder = tempfile::tempdir().expect("a folder");
    let plot = folder.path().join("validation.svg");
    let (report, code) = json(&["validate", "--plot", plot.to_str().expect("plain")]);
    assert_eq!(code, Some(0), "{report}");
    let error = |model: &str, length: f64, start: &str| {
        let rows = report["windows"].as_array().expect("rows");
        let row = rows
            .iter()
            .find(|row| row["model"] == model && (number(&row["length_s"]) - length).abs() < 1e-9)
            .expect("a row");
        number(&row[start]["median_rad"]).to_degrees()
    };
    for (length, most) in [(0.25, 5.0), (0.5, 12.0)] {
        let exact = error("exact", length, "first_frame");
        assert!(exact <= most, "{length} s: {exact} degrees");
        assert!(
            error("exact", length, "smoothed") < 0.85 * exact,
            "{length} s"
        );
        assert!(error("exact", length, "fitted") < 0.2 * exact, "{length} s");
        for model in ["as-published", "without-limb-momentum", "frozen-posture"] {
            let less = error(model, length, "first_frame");
            let least = if model == "as-published" { 5.0 } else { 4.0 };
            assert!(less > least * exact, "{model}, {length} s: {less} degrees");
        }
    }
    for whole in report["whole"].as_array().expect("rows") {
        let is_exact = whole["model"] == "exact";
        for rms in whole["rms_rad"].as_array().expect("flights") {
            assert!((number(rms).to_degrees() < 5.0) == is_exact, "{whole}");
        }
    }
    let figure = std::fs::read_to_string(plot).expect("the plot");
    assert!(figure.starts_with("<svg") && figure.matches("<polyline").count() >= 8);
}

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path.to_str().expect("plain").to_owned()
}

/// A receiver's track of a recorded flight, `shift` (s) ahead of its clock: 5 rows a second, in an axis system whose north is
/// turned, with the noise of a receiver.
fn track_of(recording: &Path, shift: f64) -> String {
    let frames: Vec<FlightFrame> = Recording::open(recording, Options::default())
        .expect("a flight")
        .map(|frame| frame.expect("a frame"))
        .collect();
    let mut text = "time_s,north_m,east_m,height_m,north_mps,east_mps,up_mps\n".to_owned();
    let mut random = 5_u64;
    let mut noise = || {
        let mut sum = 0.0;
        for _ in 0..12 {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (random >> 40) as f64 / (1u64 << 24) as f64;
        }
        0.05 * (sum - 6.0)
    };
    let last = frames[frames.len() - 1].time;
    let mut time = -1.0;
    while time <= last + 1.0 {
        // A receiver's own filter: the mean of a tenth of a second.
        let near = |frame: &&FlightFrame| (frame.time - time.clamp(0.0, last)).abs() <= 0.05;
        let velocities: Vec<_> = frames
            .iter()
            .filter(near)
            .map(|frame| frame.pelvis.velocity.expect("a velocity").components)
            .collect();
        let count = velocities.len() as f64;
        let mean = velocities.iter().fold([0.0; 3], |sum, velocity| {
            [
                sum[0] + velocity.x,
                sum[1] + velocity.y,
                sum[2] + velocity.z,
            ]
        });
        let [north, west, up] = mean.map(|sum| sum / count);
        let _ = writeln!(
            text,
            "{:.3},0,0,3000,{:.3},{:.3},{:.3}",
            time + shift,
            north + noise(),
            -west + noise(),
            up + noise()
        );
        time += 0.2;
    }
    text
}

#[test]
fn a_track_beside_a_suit_is_brought_to_its_clock_and_serves_as_its_velocity() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain");
    let (made, code) = json(&["synth", "side-slides", "--seed", "4", "--out", out]);
    if code != Some(0) {
        panic!("{made}");
    }
    let shift = 17.3461;
    let track = track_of(&folder.path().join("flight.mvnx"), shift);
    written(folder.path(), "TRACK.CSV", &track);
    let flight = folder.path().join("flight.toml");
    let text = std::fs::read_to_string(&flight).expect("the flight");
    let with_track = written(
        folder.path(),
        "with-track.toml",
        &format!("gnss = \"TRACK.CSV\"\n{text}"),
    );
    let (report, _) = json(&["simulate", &with_track]);
    let found = number(&report["gnss"]["shift_s"]);
    assert!((found - shift).abs() < 0.01, "{}", report["gnss"]);

    let estimated = |flight: &str| {
        let (report, _) = json(&["estimate", flight]);
        report["rms"].clone()
    };
    let (own, by_track) = (
        estimated(flight.to_str().expect("plain")),
        estimated(&with_track),
    );
    for channel in ["roll_rad", "pitch_rad"] {
        let (own, by_track) = (number(&own[channel]), number(&by_track[channel]));
        assert!(
            by_track < 1.1 * own + 0.002,
            "{channel}: {by_track} instead of {own}"
        );
    }
}

#[test]
fn recordings_are_read_packed_from_standard_input_and_by_their_folder() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain");
    json(&["synth", "rotations", "--seed", "1", "--out", out]);
    let plain = folder.path().join("flight.mvnx");
    let (by_folder, _) = json(&["simulate", out]);
    assert_eq!(
        by_folder["warnings"],
        Value::Array(Vec::new()),
        "{by_folder}"
    );
    assert_eq!(by_folder["start"], "smoothed");
    let mut child = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["inspect", "-", "--json"])
        .stdin(std::fs::File::open(&plain).expect("the file"))
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    assert!(child.wait().expect("it ends").success());
    let (message, code) = fails(&[
        "simulate",
        folder.path().join("..").to_str().expect("plain"),
    ]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("this folder has no flight.toml"),
        "{message}"
    );
    let output = bodyflight(&["simulate", plain.to_str().expect("plain")]);
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("no subject is given"), "{said}");
}

#[test]
fn broken_recordings_get_their_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain");
    json(&["synth", "rotations", "--seed", "1", "--out", out]);
    let good = std::fs::read_to_string(folder.path().join("flight.mvnx")).expect("the file");
    let changed = |element: &str, change: &dyn Fn(&[f64]) -> Vec<f64>| {
        let (open, close) = (format!("<{element}>"), format!("</{element}>"));
        let mut text = String::new();
        let mut rest = good.as_str();
        while let Some((before, after)) = rest.split_once(&open) {
            let (numbers, after) = after.split_once(&close).expect("an end");
            let numbers: Vec<f64> = numbers
                .split_whitespace()
                .map(|number| number.parse().expect("a number"))
                .collect();
            let written: Vec<String> = change(&numbers)
                .iter()
                .map(|number| format!("{number:.6}"))
                .collect();
            text += &format!("{before}{open}{}{close}", written.join(" "));
            rest = after;
        }
        text + rest
    };
    let degrees = changed("angularVelocity", &|rates| {
        rates.iter().map(|rate| rate.to_degrees()).collect()
    });
    let path = written(folder.path(), "degrees.mvnx", &degrees);
    let (report, _) = json(&["inspect", &path]);
    let said = report["flight"]["warnings"].to_string();
    assert!(said.contains("degrees"), "{said}");

    let reordered = changed("orientation", &|numbers| {
        numbers
            .chunks(4)
            .flat_map(|q| [q[1], q[2], q[3], q[0]])
            .collect()
    });
    let path = written(folder.path(), "xyzw.mvnx", &reordered);
    let (message, code) = fails(&["simulate", &path]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("x y z w") && message.contains("write them as w x y z"),
        "{message}"
    );

    let rising = changed("velocity", &|numbers| {
        numbers.iter().map(|speed| -speed).collect()
    });
    let path = written(folder.path(), "rising.mvnx", &rising);
    let (report, _) = json(&["inspect", &path]);
    let said = report["flight"]["warnings"].to_string();
    assert!(
        said.contains("opposite ways") && said.contains("rises by"),
        "{said}"
    );

    let rate = good.replacen("frameRate=\"240\"", "frameRate=\"120\"", 1);
    let path = written(folder.path(), "rate.mvnx", &rate);
    let (report, _) = json(&["inspect", &path]);
    let said = report["flight"]["warnings"].to_string();
    assert!(said.contains("the header 120.0"), "{said}");

    let flight = folder.path().join("flight.toml");
    let flight = flight.to_str().expect("plain");
    let (message, code) = fails(&["discover", flight, "--hold-out", flight]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("it is the one that effects are fitted to"),
        "{message}"
    );
}
