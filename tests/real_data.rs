//! Real flights and real falls, through the real binary.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::fmt::Write;
use std::io::Write as _;
use std::path::{Path, PathBuf};
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

/// Rows of a FlySight 1: an aircraft, a fall of 55 s belly to earth, an opening, a canopy that circles, the ground.
fn jump(seed: u64) -> String {
    let mut text = "time,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc,sAcc,gpsFix,numSV\n\
                    ,(deg),(deg),(m),(m/s),(m/s),(m/s),(m),(m),(m/s),,\n"
        .to_owned();
    let (mut height, mut velocity) = (4000.0_f64, [0.0, -45.0, 0.0_f64]);
    let mut random = seed;
    let mut noise = || {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (random >> 40) as f64 / (1u64 << 24) as f64 - 0.5
    };
    const STEP: f64 = 0.02;
    let mut rest = 0.0;
    let mut step = 0_u32;
    while rest < 15.0 {
        let time = f64::from(step) * STEP;
        if step.is_multiple_of(10) {
            let second = time % 60.0;
            let minute = 10 + (time / 60.0) as u32;
            let [north, west, up] = velocity;
            let _ = writeln!(
                text,
                "2024-06-01T12:{minute:02}:{second:05.2}Z,46.0,8.0,{height:.2},{:.2},{:.2},{:.2},3.0,4.0,0.4,3,12",
                north + 0.3 * noise(),
                -west + 0.3 * noise(),
                -up + 0.3 * noise()
            );
        }
        step += 1;
        let since = time - 30.0;
        let density = 1.225 * (1.0 - 2.2558e-5 * height).powf(4.2559);
        let wind = [6.0 * height / 4000.0, 3.0, 0.0];
        let air = [0, 1, 2].map(|axis| velocity[axis] - wind[axis]);
        let speed = air.iter().map(|part| part * part).sum::<f64>().sqrt();
        if height <= 400.0 {
            velocity = [0.0; 3];
            rest += STEP;
        } else if (0.0..59.0).contains(&since) {
            let opened = ((since - 55.0) / 3.0).clamp(0.0, 1.0);
            let pull = 0.5 * density * speed * (1.0 / 153.0 + 0.25 * opened * opened);
            for axis in 0..3 {
                velocity[axis] -= air[axis] * pull * STEP;
            }
            velocity[2] -= 9.81 * STEP;
        } else if since >= 59.0 {
            let heading = 0.4 * since;
            let wanted = [
                wind[0] + 12.0 * heading.cos(),
                wind[1] + 12.0 * heading.sin(),
                -5.5,
            ];
            for axis in 0..3 {
                velocity[axis] += (wanted[axis] - velocity[axis]) * STEP;
            }
        }
        height += velocity[2] * STEP;
    }
    text
}

fn written(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("written");
    path.to_str().expect("plain").to_owned()
}

#[test]
fn a_fall_is_told_as_it_was_flown() {
    let folder = tempfile::tempdir().expect("a folder");
    let track = written(folder.path(), "12-10-00.CSV", &jump(1));
    let plot = folder.path().join("fall.svg");
    let arguments = [
        "fall",
        &track,
        "--mass",
        "80",
        "--plot",
        plot.to_str().expect("plain"),
    ];
    let (report, code) = json(&arguments);
    assert_eq!(
        (code, &report["verdict"]),
        (Some(0), &Value::from("explained")),
        "{report}"
    );
    let near = |name: &str, value: &Value, expected: f64, most: f64| {
        let off = (number(value) - expected).abs();
        assert!(off < most, "{name}: {value}, expected {expected}");
    };
    near("exit", &report["exit"]["time_s"], 30.0, 0.5);
    near("opening", &report["opening"]["time_s"], 85.0, 1.0);
    near("drag area", &report["drag_area_m2"], 80.0 / 153.0, 0.015);
    near("ballistic", &report["ballistic_kgpm2"], 153.0, 4.0);
    assert_eq!(
        report["pieces"].as_array().map(Vec::len),
        Some(1),
        "{report}"
    );
    for wind in report["wind"].as_array().expect("layers") {
        let blows = [6.0 * number(&wind["height_m"]) / 4000.0, 3.0_f64];
        let from = number(&wind["from_rad"]);
        let speed = number(&wind["speed_mps"]);
        // North and west of where it blows to.
        let found = [-speed * from.cos(), speed * from.sin()];
        let apart = (found[0] - blows[0]).hypot(found[1] - blows[1]);
        assert!(apart < 3.5 * number(&wind["deviation_mps"]) + 0.3, "{wind}");
    }
    assert!(number(&report["winds_apart"]) < 2.5, "{report}");
    let prediction = &report["prediction"];
    let ratio = number(&prediction["predicted_mps"]) / number(&prediction["measured_mps"]);
    assert!((ratio - 1.0).abs() < 0.03, "{prediction}");
    assert!(
        std::fs::read_to_string(plot)
            .expect("the plot")
            .starts_with("<svg")
    );
}

#[test]
fn a_track_may_come_from_standard_input_and_one_without_a_fall_is_refused() {
    let text = jump(2);
    let mut child = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(["fall", "-", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut input = child.stdin.take().expect("a pipe");
    input.write_all(text.as_bytes()).expect("written");
    drop(input);
    let output = child.wait_with_output().expect("it ends");
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(report["verdict"], "explained", "{report}");

    let folder = tempfile::tempdir().expect("a folder");
    let aircraft: String = text
        .lines()
        .take(140)
        .map(|line| format!("{line}\n"))
        .collect();
    let (message, code) = fails(&["fall", &written(folder.path(), "up.csv", &aircraft)]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("no free fall on this track"), "{message}");
    let track = written(folder.path(), "fall.csv", &text);
    let (message, code) = fails(&["fall", &track, "--mass", "3"]);
    assert_eq!(code, Some(2));
    assert!(
        message.contains("--mass: expected 30 to 300, found 3"),
        "{message}"
    );
}

fn public_tracks() -> Option<PathBuf> {
    let folder =
        PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/flysight/skyderby");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("skipped: {} is absent", folder.display());
    None
}

/// Exit and opening as read off the plots in docs/falls.md: when the vertical velocity leaves that of the aircraft, and
/// when the deployment begins to slow the fall down (s).
const MARKED: [(&str, f64, f64); 3] = [
    ("_703_14-41-39.CSV", 515.6, 619.6),
    ("fs2-track.csv", 338.4, 461.2),
    ("speed_skydiving_411.csv", 30.6, 69.4),
];

#[test]
fn public_falls_are_divided_as_a_person_does_and_explained() {
    let Some(folder) = public_tracks() else {
        return;
    };
    for (name, exit, opening) in MARKED {
        let path = folder.join(name);
        let (report, code) = json(&["fall", path.to_str().expect("plain")]);
        assert_eq!(code, Some(0), "{name}: {report}");
        assert_eq!(report["verdict"], "explained", "{name}: {report}");
        for (moment, marked) in [("exit", exit), ("opening", opening)] {
            let off = (number(&report[moment]["time_s"]) - marked).abs();
            assert!(off < 1.0, "{name}, {moment}: {}", report[moment]);
        }
        let area = number(&report["drag_area_m2"]);
        assert!((0.08..0.9).contains(&area), "{name}: {area} m2");
    }
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
