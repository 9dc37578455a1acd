//! Streaming with the real binary to a unit behind a pseudo-terminal.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "stream/alone.rs"]
mod alone;
#[path = "stream/calibration.rs"]
mod calibration;

use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;

fn bodyflight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Makes a synthetic flight; returns its `flight.toml`.
fn flight(folder: &Path) -> String {
    let out = folder.join("flight");
    let output = bodyflight()
        .args(["synth", "rotations", "--seed", "3", "--out"])
        .arg(&out)
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    out.join("flight.toml").display().to_string()
}

fn stream(arguments: &[&str]) -> Output {
    bodyflight()
        .args(["stream", "--json"])
        .args(arguments)
        .output()
        .expect("the binary starts")
}

fn report(output: &Output) -> Value {
    assert!(output.status.success(), "{}", text(&output.stderr));
    serde_json::from_slice(&output.stdout).expect("standard output is JSON")
}

/// A running `bodyflight unit`, which ends with the test.
struct Unit {
    process: Child,
    port: String,
}

impl Unit {
    fn start() -> Self {
        Self::start_with(&[])
    }

    fn start_with(arguments: &[&str]) -> Self {
        let mut process = bodyflight()
            .arg("unit")
            .args(arguments)
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let output = process.stdout.take().expect("it is piped");
        let mut port = String::new();
        BufReader::new(output)
            .read_line(&mut port)
            .expect("it prints its port");
        Self {
            process,
            port: port.trim().to_owned(),
        }
    }
}

impl Drop for Unit {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

#[test]
fn estimates_equal_the_desktops_bit_for_bit() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    let report = report(&stream(&[&flight, "--virtual", "--seconds", "2"]));
    assert_eq!(report["sent"], 481);
    assert_eq!(report["estimates"]["expected"], 120);
    assert_eq!(report["estimates"]["equal"], 120);
    assert_eq!(report["unit"]["used"], 481);
    assert_eq!(report["unit"]["missing"], 0);
    let wall = report["wall_s"].as_f64().expect("a number");
    assert!((2.0..3.5).contains(&wall), "{wall} s");
}

#[test]
fn the_unit_flies_with_effects() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    let model = folder.path().join("model.toml");
    let streamed = |effects: &str| {
        std::fs::write(&model, effects).expect("a file");
        let model = model.to_str().expect("a plain path");
        stream(&[
            &flight,
            "--virtual",
            "--speed",
            "max",
            "--model",
            model,
            "--seconds",
            "2",
        ])
    };
    let effects = "[[effect]]\nname = \"wind\"\nnorth_mps = 4.0\n\n\
                   [[effect]]\nname = \"lift\"\narms_factor = 1.5\n\n\
                   [[effect]]\nname = \"arch\"\nfactor = 1.5\n";
    let report = report(&streamed(effects));
    assert_eq!(
        report["estimates"]["equal"],
        report["estimates"]["expected"]
    );
    let refused = streamed("[[effect]]\nname = \"density-gradient\"\nper_km = 0.1\n");
    assert_eq!(refused.status.code(), Some(2));
    assert!(text(&refused.stderr).contains("a single density"));
}

#[test]
fn faults_are_counted_and_estimates_still_agree() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    let faults = ["--drop", "0.05", "--corrupt", "0.05", "--reorder", "0.02"];
    for seed in ["1", "2", "3"] {
        let arguments = [&flight, "--virtual", "--speed", "max", "--seed", seed];
        let report = report(&stream(&[&arguments[..], &faults].concat()));
        let count = |path: [&str; 2]| report[path[0]][path[1]].as_u64().expect("a count");
        let harmed = count(["harmed", "dropped"]) + count(["harmed", "corrupted"]);
        assert!(harmed > 100);
        assert_eq!(count(["unit", "missing"]), harmed);
        assert_eq!(report["accounted"], report["sent"]);
        assert_eq!(
            count(["estimates", "equal"]),
            count(["estimates", "expected"])
        );
    }
}

#[test]
fn a_stream_is_saved_as_a_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    let kept = folder.path().join("kept.mvnx").display().to_string();
    let arguments = [&flight, "--virtual", "--speed", "max", "--seconds", "3"];
    let report = report(&stream(&[&arguments[..], &["--out", &kept]].concat()));
    assert_eq!(report["kept"]["frames"], report["sent"], "{report}");
    assert_eq!(report["kept"]["frame_rate_hz"], 240.0);
    let simulated = bodyflight()
        .args(["simulate", "--json", &kept])
        .output()
        .expect("the binary starts");
    let simulated = self::report(&simulated);
    assert_eq!(
        simulated["frames"].as_u64(),
        report["sent"].as_u64().map(|sent| sent - 1)
    );
    let again = stream(&[&arguments[..], &["--out", &kept]].concat());
    assert!(text(&again.stderr).contains("--force"));
}

#[test]
fn a_unit_outlives_its_hosts() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    let unit = Unit::start();
    let arguments = [&flight, "--port", &unit.port, "--speed", "max"];
    for _ in 0..3 {
        // A host that is killed during the stream, before another one starts over on the same port.
        let mut killed = bodyflight()
            .args(["stream", &flight, "--port", &unit.port])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the binary starts");
        std::thread::sleep(Duration::from_millis(400));
        killed.kill().expect("it runs");
        killed.wait().expect("it ends");
        // Bytes that another program writes to the port in between.
        let mut port = std::fs::OpenOptions::new()
            .write(true)
            .open(&unit.port)
            .expect("the port opens");
        port.write_all(b"AT\r\nATI\r\n\0\0\x01garbage")
            .expect("it takes bytes");
        drop(port);
        let report = report(&stream(&arguments));
        assert_eq!(
            report["estimates"]["equal"],
            report["estimates"]["expected"]
        );
        assert_eq!(report["lost"], 0);
    }
}

#[test]
fn mistakes_are_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    for (arguments, code, part) in [
        (vec!["--port", "/dev/no-such-port"], 3, "bodyflight ports"),
        (vec!["--qemu", "no-such-image"], 3, "no-such-image"),
        (vec!["--virtual", "--speed", "0"], 2, "--speed"),
        (vec!["--virtual", "--drop", "2"], 2, "--drop"),
        (vec!["--virtual", "--preset", "x"], 2, "preset"),
        (vec![], 2, "--virtual"),
    ] {
        let output = stream(&[&[flight.as_str()][..], &arguments].concat());
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
        assert!(message.contains(part), "{arguments:?}: {message}");
    }
}

#[test]
fn a_port_without_a_unit_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = flight(folder.path());
    // A terminal with no unit behind it.
    let (_silent, port) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    let name = serialport::SerialPort::name(&port).expect("it has a name");
    drop(port);
    let output = stream(&[&flight, "--port", &name]);
    assert_eq!(output.status.code(), Some(3));
    let message = text(&output.stderr);
    assert!(message.contains("does not answer"), "{message}");
}

/// Runs `bodyflight unit log`; returns its report.
fn log(unit: &Unit, arguments: &[&str]) -> Value {
    let output = bodyflight()
        .args(["--json", "unit", "log", "--port", &unit.port])
        .args(arguments)
        .output()
        .expect("the binary starts");
    report(&output)
}

#[test]
fn a_flight_that_a_unit_kept_is_read_back_as_a_recording() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (flight, flash) = (flight(folder.path()), path("flash"));
    let unit = Unit::start_with(&["--flash", &flash]);
    let sent = report(&stream(&[
        &flight,
        "--port",
        &unit.port,
        "--speed",
        "max",
        "--seconds",
        "5",
    ]));
    let first = log(&unit, &["--out", &path("first")]);
    // The power is cut, but the log is kept.
    drop(unit);
    let unit = Unit::start_with(&["--flash", &flash]);
    let read = log(&unit, &["--out", &path("second")]);
    assert_eq!(read["damaged"], 0);
    assert_eq!(read["blocks"], first["blocks"]);
    let flights = read["flights"].as_array().expect("flights");
    assert_eq!(flights.len(), 1, "{read}");
    assert_eq!(flights[0]["frames"], sent["sent"]);
    assert_eq!(flights[0]["estimates"], sent["estimates"]["expected"]);
    // The recording from the log can be streamed again.
    let again = flights[0]["flight"].as_str().expect("a path");
    let recording = again.replace("flight.toml", "flight.mvnx");
    let output = bodyflight()
        .args(["inspect", &recording])
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    let again = report(&stream(&[again, "--virtual", "--speed", "max"]));
    assert_eq!(again["sent"], sent["sent"]);

    assert_eq!(log(&unit, &["--erase"])["erased"], true);
    let read = log(&unit, &["--out", &path("third")]);
    assert_eq!(
        (&read["blocks"], &read["flights"]),
        (&0.into(), &Value::Array(Vec::new()))
    );
}

#[test]
fn a_unit_without_storage_has_an_empty_log() {
    let folder = tempfile::tempdir().expect("a folder");
    let unit = Unit::start();
    let read = log(&unit, &["--out", &folder.path().display().to_string()]);
    assert_eq!(read["blocks"], 0);
}

#[test]
fn an_incomplete_image_is_not_copied() {
    let folder = tempfile::tempdir().expect("a folder");
    let (image, info) = (
        folder.path().join("unit.uf2"),
        folder.path().join("INFO_UF2.TXT"),
    );
    std::fs::write(&info, "Board-ID: RP2350\r\n").expect("a drive");
    // The first word of a UF2 file, but less than a block.
    std::fs::write(&image, b"UF2\n and no more").expect("a file");
    let output = bodyflight()
        .args(["unit", "flash"])
        .arg(&image)
        .arg("--drive")
        .arg(folder.path())
        .output()
        .expect("the binary starts");
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("it ends within"), "{message}");
    assert!(!folder.path().join("UNIT.UF2").exists());
}
