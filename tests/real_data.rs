//! Real flights, and variants of recordings and tracks, through the real binary.
#![expect(
    clippy::expect_used,
    clippy::panic,
    reason = "tests may panic: that is how they fail"
)]

use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Output, Stdio};

use bodyflight_tests::receiver::Receiver;
use serde_json::Value;

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

/// Returns the standard output as JSON, and the exit code.
fn json(arguments: &[&str]) -> (Value, Option<i32>) {
    let output = bodyflight(&[arguments, &["--json"]].concat());
    let value = serde_json::from_slice(&output.stdout);
    (
        value.unwrap_or_else(|_| panic!("{}", String::from_utf8_lossy(&output.stderr))),
        output.status.code(),
    )
}

/// Returns the error message and the exit code; terminal output may wrap anywhere.
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

/// A recording in which `change` modifies the numbers of each element of this name; it also gets the element's index.
fn changed(good: &str, element: &str, change: &dyn Fn(usize, &[f64]) -> Vec<f64>) -> String {
    let (open, close) = (format!("<{element}>"), format!("</{element}>"));
    let mut text = String::new();
    let mut rest = good;
    let mut frame = 0;
    while let Some((before, after)) = rest.split_once(&open) {
        let (numbers, after) = after.split_once(&close).expect("an end");
        let numbers: Vec<f64> = numbers
            .split_whitespace()
            .map(|number| number.parse().expect("a number"))
            .collect();
        let written: Vec<String> = change(frame, &numbers)
            .iter()
            .map(|number| format!("{number:.6}"))
            .collect();
        text += &format!("{before}{open}{}{close}", written.join(" "));
        rest = after;
        frame += 1;
    }
    text + rest
}

/// Fraction of estimated inputs within two of their stated standard deviations of the truth.
fn within_two_deviations(estimates: &Path, truth: &Path) -> f64 {
    let text = |path: &Path| std::fs::read_to_string(path).expect("a table");
    let numbers = |line: &str| -> Vec<f64> {
        let number = |cell: &str| cell.parse().unwrap_or(f64::NAN);
        line.split(',').map(number).collect()
    };
    let estimates = text(estimates);
    let column = |name: &str| {
        let mut names = estimates.lines().next().expect("names").split(',');
        names
            .position(|other| other == name)
            .expect("a column of that name")
    };
    let columns =
        ["pitch", "yaw", "roll"].map(|axis| (column(axis), column(&format!("sd_{axis}"))));
    let truth: Vec<Vec<f64>> = text(truth).lines().skip(1).map(numbers).collect();
    let (mut within, mut count) = (0.0, 0.0);
    for row in estimates.lines().skip(1).map(numbers) {
        let place = truth.partition_point(|truth| truth[0] <= row[0]).max(1) - 1;
        for (expected, (found, deviation)) in truth[place][1..].iter().zip(columns) {
            within += f64::from((row[found] - expected).abs() < 2.0 * row[deviation]);
            count += 1.0;
        }
    }
    within / count
}

#[test]
fn a_track_is_aligned_with_a_suit_and_replaces_its_velocity() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain");
    let (made, code) = json(&["synth", "side-slides", "--seed", "4", "--out", out]);
    assert_eq!(code, Some(0), "{made}");
    let recording = folder.path().join("flight.mvnx");
    let flight = folder.path().join("flight.toml");
    let text = std::fs::read_to_string(&flight).expect("the flight");
    // A suit's own velocity drifts; only its changes are accurate.
    let good = std::fs::read_to_string(&recording).expect("the recording");
    let drifted = changed(&good, "velocity", &|frame, numbers| {
        let time = frame as f64 / 240.0;
        let drift = [1.5, -2.0, 3.0 + 0.1 * time + 0.2 * (0.15 * time).sin()];
        let drifted = |(place, number): (usize, &f64)| number + drift[place % 3];
        numbers.iter().enumerate().map(drifted).collect()
    });
    written(folder.path(), "drifted.mvnx", &drifted);
    let text = text.replace("flight.mvnx", "drifted.mvnx");
    let with_track = written(
        folder.path(),
        "with-track.toml",
        &format!("gnss = \"TRACK.CSV\"\n{text}"),
    );
    let track = |deviation: f64, before: f64| {
        let receiver = Receiver {
            rate: 5.0,
            deviation,
            lasts: 0.0,
            before,
        };
        let track = receiver.track(&recording, 5);
        written(folder.path(), "TRACK.CSV", &track);
    };
    for before in [1.0873, 4.1419, 18.3461] {
        track(0.05, before);
        let (report, _) = json(&["simulate", &with_track]);
        let found = number(&report["gnss"]["shift_s"]);
        assert!((found - before).abs() < 0.01, "{}", report["gnss"]);
    }

    // The recorded velocities that it is made of have noise too, which is in what it states.
    track(0.15, 18.3461);
    let estimated = |flight: &str, name: &str| {
        let table = folder.path().join(name);
        let path = table.to_str().expect("plain");
        let (report, code) = json(&["estimate", flight, "--out", path]);
        assert_eq!(code, Some(0), "{report}");
        let within = within_two_deviations(&table, &folder.path().join("inputs.csv"));
        assert!(within > 0.95, "{name}: {within}");
        report["rms"].clone()
    };
    let own = estimated(flight.to_str().expect("plain"), "own.csv");
    let by_track = estimated(&with_track, "by-track.csv");
    for (channel, own) in own.as_object().expect("channels") {
        // Velocities are compared with the receiver's, so its noise is added.
        let noise = if channel.ends_with("velocity_mps") {
            0.1
        } else {
            0.002
        };
        let (own, by_track) = (number(own), number(&by_track[channel]));
        assert!(
            by_track < 1.1 * own + noise,
            "{channel}: {by_track} instead of {own}"
        );
    }
}

/// Compresses a file in each format; returns file names and contents.
fn packed(plain: &[u8]) -> [(&'static str, Vec<u8>); 2] {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(plain).expect("in memory");
    let mut xz = lzma_rust2::XzWriter::new(Vec::new(), lzma_rust2::XzOptions::with_preset(1))
        .expect("a preset");
    xz.write_all(plain).expect("in memory");
    [
        ("packed.mvnx.gz", gzip.finish().expect("in memory")),
        ("packed.mvnx.xz", xz.finish().expect("in memory")),
    ]
}

#[test]
fn recordings_are_read_compressed_from_standard_input_and_by_folder() {
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
    let whole = std::fs::read(&plain).expect("the file");
    let (own, _) = json(&["inspect", plain.to_str().expect("plain")]);
    let told = |report: &Value| (report["flight"].clone(), report["frames"].clone());
    assert!(!own["flight"].is_null(), "{own}");
    for (name, bytes) in packed(&whole) {
        let path = folder.path().join(name);
        std::fs::write(&path, &bytes).expect("written");
        let (by_name, _) = json(&["inspect", path.to_str().expect("plain")]);
        assert_eq!(told(&by_name), told(&own), "{name}");
        let mut child = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["inspect", "-", "--json"])
            .stdin(std::fs::File::open(&path).expect("the file"))
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let mut output = child.stdout.take().expect("a pipe");
        let by_input: Value = serde_json::from_reader(&mut output).expect("JSON");
        assert!(child.wait().expect("it ends").success());
        assert_eq!(
            by_input["frames"], own["frames"],
            "{name} on standard input"
        );
        // Truncated data are reported, with the file name.
        std::fs::write(&path, &bytes[..bytes.len() / 2]).expect("written");
        let (message, code) = fails(&["simulate", path.to_str().expect("plain")]);
        assert!(code.is_some_and(|code| code != 0), "{message}");
        assert!(message.contains(name), "{message}");
    }
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
    assert!(said.contains("no subject was given"), "{said}");
}

/// A recording with the points of its segments removed.
fn without_points(good: &str) -> String {
    let mut text = String::new();
    let mut rest = good;
    while let Some((before, after)) = rest.split_once("<points>") {
        text += before;
        rest = after.split_once("</points>").expect("an end").1;
    }
    text + rest
}

#[test]
fn broken_recordings_have_their_messages() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().to_str().expect("plain");
    json(&["synth", "rotations", "--seed", "1", "--out", out]);
    let good = std::fs::read_to_string(folder.path().join("flight.mvnx")).expect("the file");
    let changed = |element: &str, change: &dyn Fn(&[f64]) -> Vec<f64>| {
        changed(&good, element, &|_, numbers| change(numbers))
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
        said.contains("opposite directions") && said.contains("rises by"),
        "{said}"
    );

    let rate = good.replacen("frameRate=\"240\"", "frameRate=\"120\"", 1);
    let path = written(folder.path(), "rate.mvnx", &rate);
    let (report, _) = json(&["inspect", &path]);
    let said = report["flight"]["warnings"].to_string();
    assert!(said.contains("the header 120.0"), "{said}");

    // A gap of 0.2 s without frames.
    let (before, after) = good.split_once("<frame time=\"1000\"").expect("a frame");
    let (_, after) = after.split_once("<frame time=\"1200\"").expect("a frame");
    let path = written(
        folder.path(),
        "gap.mvnx",
        &format!("{before}<frame time=\"1200\"{after}"),
    );
    let (report, _) = json(&["inspect", &path]);
    let said = report["flight"]["warnings"].to_string();
    assert!(said.contains("s without frames"), "{said}");

    // A flight must have at least two seconds to be judged.
    let (begun, _) = good.split_once("<frame time=\"1500\"").expect("a frame");
    let path = written(
        folder.path(),
        "short.mvnx",
        &format!("{begun}</frames></subject></mvnx>"),
    );
    let (report, _) = json(&["inspect", &path]);
    let warnings = &report["flight"]["warnings"];
    let said = warnings.to_string();
    assert!(said.contains("the flight ends after 1.50 s"), "{said}");
    // The last frame is reported by its number.
    assert_eq!(warnings[0]["frame"], 359, "{said}");

    // Without joint points, a file does not reveal its arm convention.
    let pointless = without_points(&good);
    let path = written(folder.path(), "pointless.mvnx", &pointless);
    let (message, code) = fails(&["simulate", &path]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("--arm-frame t-pose or isb"), "{message}");
    let arms = |arms: &str| {
        let (report, code) = json(&["simulate", &path, "--arm-frame", arms]);
        assert_eq!(code, Some(0), "{report}");
        report["rms"].clone()
    };
    assert_ne!(arms("t-pose"), arms("isb"));

    let flight = folder.path().join("flight.toml");
    let flight = flight.to_str().expect("plain");
    let (message, code) = fails(&["discover", flight, "--hold-out", flight]);
    assert_eq!(code, Some(2), "{message}");
    assert!(
        message.contains("effects are also fitted to it"),
        "{message}"
    );
}
