//! `unit calibrate` on a unit behind a pseudo-terminal, with the line of the sensors on the limbs behind another.

use std::io::{BufRead, BufReader, Write};
use std::process::{Output, Stdio};

use serde_json::Value;
use serialport::{SerialPort, TTYPort};

use super::{Unit, bodyflight, text};

/// Bytes of ten sensors in a second.
const SECOND: usize = 10 * 25 * 100;
/// End of the poses in the bytes (s).
const POSES: usize = 66;

/// Runs a verb that must succeed.
fn done(arguments: &[&str]) -> Output {
    let output = bodyflight()
        .args(arguments)
        .output()
        .expect("the binary starts");
    assert!(output.status.success(), "{}", text(&output.stderr));
    output
}

/// Runs `unit calibrate` and sends `bytes` on the line of the sensors once it has begun; returns its exit code and all that it
/// says.
fn calibrate(
    unit: &Unit,
    line: &mut TTYPort,
    bytes: &[u8],
    patience: &str,
) -> (Option<i32>, String) {
    let mut process = bodyflight()
        .args([
            "unit",
            "calibrate",
            "--port",
            &unit.port,
            "--patience",
            patience,
        ])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the binary starts");
    let mut notes = BufReader::new(process.stderr.take().expect("it is piped"));
    let mut said = String::new();
    notes.read_line(&mut said).expect("its first state");
    line.write_all(bytes).expect("the unit reads its sensors");
    for note in notes.lines() {
        said = said + " " + note.expect("text").trim();
    }
    let output = process.wait_with_output().expect("it ends");
    (output.status.code(), said + &text(&output.stdout))
}

#[test]
fn a_unit_is_calibrated_by_poses_and_not_while_somebody_moves() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name).display().to_string();
    let (jump, flash) = (path("jump"), path("flash"));
    done(&[
        "synth",
        "exit-and-tracking",
        "--sensors",
        "10",
        "--chain",
        "--out",
        &jump,
    ]);
    let flight = path("jump/flight.toml");
    let configure = [
        "unit",
        "configure",
        &flight,
        "--protocol",
        "chain",
        "--rate",
        "100",
    ];
    done(&[&configure[..], &["--flash", &flash]].concat());
    let bytes = std::fs::read(path("jump/chain.bin")).expect("the bytes of the line");
    let poses = &bytes[..POSES * SECOND];
    let falling = &bytes[bytes.len() - 3 * SECOND..];

    let (mut line, sensors) = TTYPort::pair().expect("a pseudo-terminal");
    let name = sensors.name().expect("a name");
    // The binary needs exclusive access.
    drop(sensors);
    let unit = Unit::start_with(&["--flash", &flash, "--sensor", &name]);
    let show = || {
        let shown = done(&["--json", "unit", "show", "--port", &unit.port]);
        let shown: Value = serde_json::from_slice(&shown.stdout).expect("JSON");
        shown["limbs"].as_array().expect("sensors").len()
    };

    let (code, said) = calibrate(&unit, &mut line, falling, "1");
    assert_eq!(code, Some(2), "{said}");
    let refused =
        "10 sensors on the limbs are not calibrated: of the rests of a calibration 0 were seen";
    let words: Vec<_> = said
        .split_whitespace()
        .filter(|word| *word != "│")
        .collect();
    assert!(words.join(" ").contains(refused), "{said}");
    assert!(said.contains("stand upright with the arms down"), "{said}");
    assert_eq!(show(), 0);

    let (code, said) = calibrate(&unit, &mut line, poses, "60");
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("10 sensors heard"), "{said}");
    assert!(
        said.contains("10 sensors are calibrated and stored"),
        "{said}"
    );
    assert_eq!(show(), 10);
}
