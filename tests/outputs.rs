//! Output files: never over an input, never over existing files unless asked, and complete or with an error.

#![cfg(unix)]
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::os::unix::fs::{FileTypeExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

fn bodyflight(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_bodyflight"))
        .args(arguments)
        .output()
        .expect("the binary starts")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn done(arguments: &[&str]) {
    let output = bodyflight(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        text(&output.stderr)
    );
}

/// Returns the error message, without line breaks, of a command that ends with this code.
fn fails(arguments: &[&str], code: i32) -> String {
    let output = bodyflight(arguments);
    let message = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    let words = message.split_whitespace().filter(|word| *word != "│");
    words.collect::<Vec<_>>().join(" ")
}

struct Place(tempfile::TempDir);

impl Place {
    /// Creates a folder with a short flight in it.
    fn new() -> Self {
        let place = Self(tempfile::tempdir().expect("a folder"));
        done(&["hide", "clean", "--duration", "2", "--out", &place.at("")]);
        place
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn at(&self, name: &str) -> String {
        self.path(name).to_str().expect("plain").to_owned()
    }

    fn written(&self, name: &str, content: &str) -> String {
        std::fs::write(self.path(name), content).expect("written");
        self.at(name)
    }
}

/// All files in a folder with their contents.
fn content(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
        let path = entry.path();
        if path.is_dir() {
            files.extend(content(&path));
        } else {
            let bytes = std::fs::read(&path).expect("a file");
            files.push((path, bytes));
        }
    }
    files.sort();
    files
}

#[test]
fn a_figure_has_the_format_of_its_name() {
    let place = Place::new();
    let flight = place.at("flight-0/flight.toml");
    let kinds = [
        ("run.svg", &b"<svg"[..]),
        ("run.pdf", b"%PDF-"),
        ("run.png", b"\x89PNG"),
    ];
    let built_in = if cfg!(feature = "full") { 3 } else { 1 };
    for (name, begin) in &kinds[..built_in] {
        let file = place.at(name);
        done(&["simulate", &flight, "--plot", &file, "--plot-title", ""]);
        let bytes = std::fs::read(&file).expect("the figure");
        assert!(bytes.starts_with(begin), "{name}");
        assert!(bytes.len() > 10_000, "{name}: {} bytes", bytes.len());
    }
    let jpeg = place.at("run.jpg");
    let message = fails(&["simulate", &flight, "--plot", &jpeg], 2);
    assert!(message.contains("ends in .svg, .pdf or .png"), "{message}");
    assert!(!place.path("run.jpg").exists());
    let out = place.at("figures");
    let formats = if cfg!(feature = "full") {
        "pdf,png"
    } else {
        "svg"
    };
    done(&["figures", &flight, "--format", formats, "--out", &out]);
    let of_each = formats.split(',').count() * 4;
    assert_eq!(std::fs::read_dir(&out).expect("a folder").count(), of_each);
    let report = place.at("report");
    done(&[
        "reproduce",
        "layouts",
        "--format",
        formats,
        "--out",
        &report,
    ]);
    // SVG is there whatever else is asked for.
    for format in formats.split(',').chain(["svg"]) {
        let bytes = std::fs::read(place.path(&format!("report/layouts.{format}")));
        let mut kinds = kinds.iter().filter(|kind| kind.0.ends_with(format));
        assert!(kinds.all(|kind| bytes.as_ref().is_ok_and(|bytes| bytes.starts_with(kind.1))));
    }
    std::fs::remove_file(place.path("report/report.md")).expect("a report");
    let message = fails(&["reproduce", "layouts", "--out", &report], 2);
    assert!(
        message.contains("layouts.svg") && message.contains("--force"),
        "{message}"
    );
}

#[test]
fn no_output_replaces_a_file_that_is_read() {
    let place = Place::new();
    let flight = place.at("flight-0/flight.toml");
    let model = place.written("model.toml", "effect = []\n");
    let inside = place.at("flight-1/../flight-0/flight.mvnx");
    let subject = place.at("flight-0/./subject.toml");
    symlink("flight-0/flight.mvnx", place.path("link.mvnx")).expect("a link");
    let link = place.at("link.mvnx");
    let preset = place.written("preset.toml", "joint_error_deg = 0.5\n");
    // A link named like a figure: its target is what counts.
    let drawn = |target: &str| {
        let name = format!("{}.svg", target.replace('/', "-"));
        symlink(target, place.path(&name)).expect("a link");
        place.at(&name)
    };
    let [drawn_subject, drawn_model, drawn_preset] =
        ["flight-0/subject.toml", "model.toml", "preset.toml"].map(drawn);
    let before = content(place.0.path());
    for arguments in [
        &["simulate", &flight, "--out", &inside][..],
        &["simulate", &flight, "--plot", &drawn_subject],
        &["simulate", &flight, "--out", &link],
        &[
            "simulate",
            &flight,
            "--model",
            &model,
            "--plot",
            &drawn_model,
        ],
        &["estimate", &flight, "--out", &inside],
        &["estimate", &flight, "--model", &model, "--out", &model],
        &[
            "estimate",
            &flight,
            "--preset",
            &preset,
            "--plot",
            &drawn_preset,
        ],
        &["view", &flight, "--out", &subject],
        &["view", &flight, "--model", &model, "--out", &model],
        &["fly", &subject, "--out", &subject],
        &["tune", &flight, "--draws", "1", "--out", &subject],
        &[
            "synth",
            "rotations",
            "--subject",
            &subject,
            "--out",
            &place.at("flight-0"),
        ],
        &[
            "hide",
            "clean",
            "--subject",
            &subject,
            "--out",
            &place.at(""),
        ],
    ] {
        let message = fails(&[arguments, &["--force"]].concat(), 2);
        assert!(
            message.contains("would be overwritten"),
            "{arguments:?}: {message}"
        );
    }
    assert!(content(place.0.path()) == before, "nothing has changed");
}

#[test]
fn what_exists_is_replaced_only_with_force() {
    let place = Place::new();
    let flight = place.at("flight-0/flight.toml");
    let out = place.written("kept", "mine");
    let figure = place.written("kept.svg", "mine");
    let folder = place.at("flight-1");
    let before = content(place.0.path());
    for arguments in [
        &["simulate", &flight, "--out", &out][..],
        &["simulate", &flight, "--plot", &figure],
        &["estimate", &flight, "--out", &out],
        &["view", &flight, "--out", &out],
        &["fly", "--out", &out],
        &["tune", &flight, "--draws", "1", "--out", &out],
        &["validate", &flight, "--plot", &figure],
        &["synth", "rotations", "--out", &folder],
        &["demo", "--out", &folder],
        &["hide", "clean", "--out", &place.at("")],
    ] {
        let message = fails(arguments, 2);
        assert!(
            message.contains("this file exists") && message.contains("--force"),
            "{arguments:?}: {message}"
        );
    }
    assert!(content(place.0.path()) == before, "nothing has changed");
    let table = place.written("kept.csv", "mine");
    done(&["simulate", &flight, "--out", &table, "--force"]);
    assert_ne!(std::fs::read(&table).expect("a file"), b"mine");
}

#[test]
fn outputs_follow_links_and_refuse_devices() {
    let place = Place::new();
    let flight = place.at("flight-0/flight.toml");
    let real = place.written("real.csv", "old");
    symlink("real.csv", place.path("link.csv")).expect("a link");
    let link = place.at("link.csv");
    done(&["simulate", &flight, "--out", &link, "--force"]);
    assert!(
        place
            .path("link.csv")
            .symlink_metadata()
            .expect("it")
            .is_symlink()
    );
    let written = std::fs::read_to_string(&real).expect("the file");
    assert!(written.starts_with("time_s"), "{written}");

    let pipe = place.at("pipe");
    let made = Command::new("mkfifo").arg(&pipe).status().expect("mkfifo");
    assert!(made.success());
    for target in [&pipe, "/dev/null"] {
        let message = fails(&["simulate", &flight, "--out", target, "--force"], 2);
        assert!(message.contains("found a device or a pipe"), "{message}");
    }
    let kind = std::fs::metadata(&pipe).expect("it").file_type();
    assert!(kind.is_fifo());
    // As inputs they would deliver no data, or never end.
    for input in [&pipe, "/dev/zero"] {
        for verb in ["simulate", "inspect", "fall"] {
            let message = fails(&[verb, input], 2);
            assert!(message.contains("found a device or a pipe"), "{message}");
        }
    }
    let toml = place.at("pipe.toml");
    symlink("/dev/zero", &toml).expect("a link");
    let message = fails(&["trim", &toml], 2);
    assert!(message.contains("found a device or a pipe"), "{message}");
}

#[test]
fn files_of_settings_and_tables_have_a_largest_size() {
    let place = Place::new();
    for (name, arguments) in [
        ("subject.toml", &["trim"][..]),
        ("TRACK.CSV", &["fall"]),
        ("model.toml", &["simulate", "x.mvnx", "--model"]),
    ] {
        let path = place.at(name);
        let file = std::fs::File::create(&path).expect("a file");
        // A sparse file, which occupies no blocks on the disk.
        file.set_len(3 << 30).expect("a hole");
        let mut program = Command::new(env!("CARGO_BIN_EXE_bodyflight"));
        let mut child = program
            .args(arguments)
            .arg(&path)
            .stderr(Stdio::piped())
            .stdout(Stdio::null())
            .spawn()
            .expect("the binary starts");
        let most = largest_memory(&mut child);
        let output = child.wait_with_output().expect("it ends");
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{name}: {message}");
        assert!(message.contains("found more"), "{name}: {message}");
        assert!(most < 700 << 20, "{name}: {} MiB", most >> 20);
    }
}

/// Peak memory of a process (bytes).
fn largest_memory(child: &mut std::process::Child) -> u64 {
    let status = format!("/proc/{}/status", child.id());
    let mut most = 0;
    while child.try_wait().expect("it can be asked").is_none() {
        let text = std::fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().split(' ').next()?.parse().ok());
        most = most.max(kilobytes.unwrap_or(0) << 10);
        std::thread::sleep(Duration::from_millis(5));
    }
    most
}

#[test]
fn a_full_disk_is_an_error_everywhere() {
    let place = Place::new();
    let flight = place.at("flight-0/flight.toml");
    let recording = place.at("flight-0/flight.mvnx");
    for arguments in [
        &["inspect", &recording, "--json"][..],
        &["inspect", &recording],
        &["simulate", &flight],
        &["trim", "--json"],
        &["ports"],
        &["estimate", "--presets"],
    ] {
        let full = std::fs::File::options()
            .write(true)
            .open("/dev/full")
            .expect("the device");
        let output = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(arguments)
            .stdout(full)
            .output()
            .expect("the binary starts");
        let message = text(&output.stderr);
        assert_eq!(output.status.code(), Some(3), "{arguments:?}: {message}");
        assert!(message.contains("standard output"), "{message}");
    }
}

#[test]
fn termination_leaves_no_file_behind() {
    let place = Place::new();
    for signal in ["TERM", "HUP", "INT"] {
        let out = place.path(signal);
        let mut child = Command::new(env!("CARGO_BIN_EXE_bodyflight"))
            .args(["hide", "clean", "--duration", "300", "--flights", "50"])
            .arg("--out")
            .arg(&out)
            .stdout(Stdio::null())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let begin = Instant::now();
        while !out.join("flight-0").is_dir() {
            assert!(begin.elapsed() < Duration::from_secs(60), "{signal}: slow");
            std::thread::sleep(Duration::from_millis(5));
        }
        let kill = Command::new("kill")
            .args([&format!("-{signal}"), &child.id().to_string()])
            .status();
        assert!(kill.expect("kill").success());
        let status = child.wait().expect("it ends");
        assert_eq!(status.code(), Some(130), "{signal}: {status}");
        for (path, _) in content(&out) {
            let name = path.file_name().expect("a name").to_string_lossy();
            assert!(
                !name.starts_with(".bodyflight-"),
                "{signal}: {}",
                path.display()
            );
        }
    }
}

#[test]
fn a_search_checks_its_folder_first() {
    let place = Place::new();
    let [flight, other] = ["flight-0", "flight-1"].map(|name| place.at(name));
    let out = place.at("flight-0/flight.toml");
    let begin = Instant::now();
    let message = fails(
        &["discover", &flight, "--hold-out", &other, "--out", &out],
        3,
    );
    assert!(message.contains("flight.toml"), "{message}");
    assert!(begin.elapsed() < Duration::from_secs(5), "{begin:?}");
}

/// A name that the shell put in place of `*` may be an argument.
#[test]
fn arguments_do_not_reach_the_terminal_as_commands() {
    for arguments in [
        &["\u{1b}[2Jevil"][..],
        &["inspect", "--a\u{9b}2J"],
        &["inspect", "a\u{1b}[2J.mvnx"],
        &["trim", "--\u{202e}", "--json"],
    ] {
        let output = bodyflight(arguments);
        let shown = text(&output.stderr);
        assert!(!output.status.success() && !shown.is_empty());
        assert!(
            !shown.contains(['\u{1b}', '\u{9b}', '\u{202e}']),
            "{shown:?}"
        );
    }
}

#[test]
fn names_in_files_do_not_reach_the_terminal_as_commands() {
    let place = Place::new();
    let path = place.path("flight-0/flight.mvnx");
    let recording = std::fs::read_to_string(&path).expect("the recording");
    assert!(recording.contains("Laboratory"));
    let evil = recording.replace("Laboratory", "A\u{9b}2J\u{202e}B&#x9b;C");
    std::fs::write(&path, evil).expect("written");
    for json in [&["--json"][..], &[]] {
        let path = path.to_str().expect("plain");
        let output = bodyflight(&[&["inspect", path], json].concat());
        let shown = text(&output.stdout);
        assert!(output.status.success() && shown.contains('A'), "{shown}");
        assert!(!shown.contains(['\u{9b}', '\u{202e}']), "{shown:?}");
    }
}
