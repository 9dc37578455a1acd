//! The program, and the files that documented commands read.

use std::fmt::Write as _;
use std::fs;
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Command, Output};

use bodyflight_tests::slimevr_trackers::{Form, Tracker, pcap};

/// The program.
pub(crate) const BODYFLIGHT: &str = env!("CARGO_BIN_EXE_bodyflight");

/// Runs the program in a folder.
pub(crate) fn bodyflight(folder: &Path, arguments: &[&str]) -> Output {
    Command::new(BODYFLIGHT)
        .args(arguments)
        .current_dir(folder)
        .output()
        .expect("the binary starts")
}

/// A falling point, ten times a second: 3 s in an aircraft, 40 s in free fall, 40 s under a canopy.
fn track() -> String {
    let mut text = "time_s,north_m,east_m,height_m\n".to_owned();
    let (mut north, mut height, mut speed) = (0.0, 4000.0, [40.0, 0.0_f64]);
    for step in 0..830 {
        let time = 0.1 * f64::from(step);
        let (ahead, down) = match step {
            0..30 => (40.0, 0.0),
            30..430 => (
                speed[0] * 0.98,
                speed[1] + 0.1 * (9.8 - 0.0039 * speed[1] * speed[1]),
            ),
            _ => (8.0_f64.max(speed[0]), 5.0_f64.max(speed[1] * 0.8)),
        };
        speed = [ahead, down];
        (north, height) = (north + 0.1 * ahead, height - 0.1 * down);
        let _ = writeln!(text, "{time:.1},{north:.2},0,{height:.2}");
    }
    text
}

/// Creates all files that the examples name, except for ports, drives and images.
pub(crate) fn prepared(place: &Path) {
    let ends = |arguments: &[&str]| {
        let output = bodyflight(place, arguments);
        assert!(output.status.success(), "{arguments:?}: {output:?}");
    };
    ends(&[
        "hide",
        "clean",
        "--duration",
        "2",
        "--flights",
        "4",
        "--out",
        ".",
    ]);
    for (from, to) in [
        ("flight-1", "turn-1"),
        ("flight-2", "turn-2"),
        ("flight-3", "turn-3"),
    ] {
        fs::rename(place.join(from), place.join(to)).expect("moved");
    }
    for (from, to) in [
        ("turn-1", "student"),
        ("turn-2", "expert"),
        ("turn-2", "jump-1"),
        ("turn-3", "jump-2"),
    ] {
        copied(&place.join(from), &place.join(to));
    }
    for name in ["flight.toml", "flight.mvnx", "subject.toml"] {
        fs::copy(place.join("flight-0").join(name), place.join(name)).expect("copied");
    }
    let acrobatics = Path::new(env!("CARGO_MANIFEST_DIR")).join("../verbs/data/acrobatics");
    for (from, to) in [
        ("joint-angles-1.csv.gz", "jump.csv"),
        ("joint-angles.toml", "mapping.toml"),
        ("subject-1.toml", "athlete.toml"),
        ("segments-1.json", "segments-1.json"),
        ("flight-1.mvnx.gz", "somersault.mvnx"),
    ] {
        fs::copy(acrobatics.join(from), place.join(to)).expect("copied");
    }
    for folder in ["found", "CARD", "24-07-14"] {
        fs::create_dir(place.join(folder)).expect("a folder");
    }
    let found = [
        ("TRACK.CSV", track()),
        ("CARD/TRACK.CSV", track()),
        ("24-07-14/TRACK.CSV", track()),
        (
            "found/model.toml",
            "[[effect]]\nname = \"wind\"\nnorth_mps = 1.0\n".to_owned(),
        ),
        (
            "found/report.json",
            "{\"verdict\": \"none\", \"effects\": []}".to_owned(),
        ),
        (
            "captures.toml",
            "[[captures]]\nsource = \"laboratory\"\nperson = \"1\"\nfile = \"jump.csv\"\nmapping = \"mapping.toml\"\n\
             subject = \"athlete.toml\"\n"
                .to_owned(),
        ),
        ("recording.bin", String::new()),
    ];
    for (name, text) in found {
        fs::write(place.join(name), text).expect("written");
    }
    fs::write(place.join("traffic.pcap"), traffic()).expect("written");
}

/// What a tracker sends in a second.
fn traffic() -> Vec<u8> {
    let from = SocketAddr::from(([192, 168, 1, 7], 6969));
    let mut tracker = Tracker::new(1, Form::Bundled);
    let mut all = vec![(0.0, from, tracker.handshake(13))];
    for k in 0..100 {
        let packets = tracker.sample(0, &Default::default(), &Default::default());
        all.extend(
            packets
                .into_iter()
                .map(|packet| (0.01 * f64::from(k), from, packet)),
        );
    }
    pcap(&all)
}

/// Copies a folder by hard links, for an example to run in.
pub(crate) fn copied(from: &Path, to: &Path) {
    fs::create_dir(to).expect("a folder");
    for entry in fs::read_dir(from).expect("the folder").flatten() {
        let (path, copy) = (entry.path(), to.join(entry.file_name()));
        if path.is_dir() {
            copied(&path, &copy);
        } else {
            fs::hard_link(&path, &copy).expect("linked");
        }
    }
}
