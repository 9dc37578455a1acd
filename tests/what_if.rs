//! What if: a flight simulated again with a change, by the real binary.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use bodyflight_core::body::pattern;
use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_mvnx::recording::{FlightFrame, PelvisMotion};
use bodyflight_mvnx::writer::{Description, Origin, Writer};
use bodyflight_replay::subject::Subject;
use bodyflight_shared_data::{shared, skipped};
use bodyflight_tests::program::{Program, plain, text, written};
use bodyflight_tests::{numbers, quaternion, reference, vector};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// A belly fall of 4 s, without noise.
fn belly(folder: &Path) -> String {
    let out = plain(&folder.join("belly")).to_owned();
    PROGRAM.json(&[
        "hide",
        "clean",
        "--flights",
        "1",
        "--duration",
        "4",
        "--noise",
        "0",
        "--out",
        &out,
    ]);
    plain(&folder.join("belly/flight-0")).to_owned()
}

fn number(value: &Value, pointer: &str) -> f64 {
    value
        .pointer(pointer)
        .and_then(Value::as_f64)
        .expect(pointer)
}

#[test]
fn a_bent_knee_begins_with_the_same_motion_and_turns_the_other_way_on_the_other_side() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = belly(folder.path());
    let mut turned = Vec::new();
    for joint in ["l_shank", "r_shank"] {
        let change = format!("{joint}.bend=+20@1.0..2.5");
        let report = PROGRAM.json(&["simulate", &flight, "--joint", &change]);
        assert_eq!(report["joints"][0]["joint"], format!("{joint}.bend"));
        let [recorded, changed] = ["recorded_rad", "changed_rad"]
            .map(|key| number(&report, &format!("/joints/0/{key}/1")));
        assert!(changed > recorded + 0.2, "{report}");
        for row in report["over_time"].as_array().expect("rows") {
            let apart = number(row, "/attitude_difference_rad");
            let is_before = number(row, "/time_s") <= 1.0;
            assert_eq!(apart < 1e-9, is_before, "{row}");
        }
        turned.push(number(&report, "/turned_rad/difference"));
    }
    assert!(turned[0] * turned[1] < 0.0, "{turned:?}");
    assert!(turned.iter().all(|turn| turn.abs() > 0.02), "{turned:?}");
}

#[test]
fn no_change_of_a_joint_changes_nothing_and_curves_are_constants_if_they_are_flat() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = belly(folder.path());
    let none = PROGRAM.json(&["simulate", &flight, "--joint", "l_thigh.theta=0"]);
    assert!(
        number(&none, "/largest_attitude_difference_rad") < 1e-9,
        "{none}"
    );
    let curve = written(folder.path(), "flat.csv", "time_s,more\n0,20\n9,20\n");
    let by_curve = PROGRAM.json(&[
        "simulate",
        &flight,
        "--joint",
        &format!("l_shank.bend={curve}:more"),
    ]);
    let constant = PROGRAM.json(&["simulate", &flight, "--joint", "l_shank.bend=+20"]);
    assert_eq!(by_curve["over_time"], constant["over_time"]);
    assert!(number(&constant, "/largest_attitude_difference_rad") > 0.01);
}

#[test]
fn another_person_falls_at_another_speed_and_inputs_can_be_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = belly(folder.path());
    let heavy = "height_m = 1.75\nmass_kg = 110\nsex = \"male\"\n";
    let heavy = written(folder.path(), "heavy.toml", heavy);
    let report = PROGRAM.json(&["simulate", &flight, "--subject", &heavy]);
    assert_eq!(report["other_subject"], true);
    assert!(number(&report, "/fall_mps/difference") > 0.5, "{report}");
    let out = plain(&folder.path().join("roll")).to_owned();
    PROGRAM.json(&["synth", "barrel-roll", "--out", &out]);
    let report = PROGRAM.json(&["simulate", &out, "--inputs", "none"]);
    assert!(
        number(&report, "/largest_attitude_difference_rad") > 0.3,
        "{report}"
    );
}

#[test]
fn both_runs_are_written_and_drawn() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = belly(folder.path());
    let out = plain(&folder.path().join("run.csv")).to_owned();
    let plot = plain(&folder.path().join("run.svg")).to_owned();
    let arguments = [
        "simulate",
        &flight,
        "--joint",
        "l_shank.bend=+20",
        "--out",
        &out,
        "--plot",
        &plot,
    ];
    let output = PROGRAM.run(&arguments);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said = text(&output.stdout);
    assert!(
        said.contains("turn rate, deg/s") && said.contains("l_shank.bend: recorded"),
        "{said}"
    );
    let table = std::fs::read_to_string(&out).expect("a table");
    assert!(
        table.starts_with("time_s,unchanged_roll_rad,changed_roll_rad"),
        "{table:.80}"
    );
    let drawing = std::fs::read_to_string(&plot).expect("a drawing");
    assert!(drawing.contains("unchanged") && drawing.contains("changed"));
}

#[test]
fn mistakes_name_the_joint_and_what_is_allowed() {
    let folder = tempfile::tempdir().expect("a folder");
    let flight = belly(folder.path());
    for (change, parts) in [
        ("l_knee.bend=20", ["l_knee", "l_shank"]),
        (
            "l_thigh.bend=20",
            ["l_thigh has no angle", "psi, theta, phi"],
        ),
        ("l_shank.bend=much", ["l_shank.bend", "FILE.csv:COLUMN"]),
        (
            "l_shank.bend=20@50..60",
            [
                "a window within the flight, from 0.00 to 4.00 s",
                "changes nothing",
            ],
        ),
        (
            "l_shank.bend=20@-5..-1",
            ["a window within the flight", "found -5 to -1 s"],
        ),
    ] {
        let said = PROGRAM.fails(&["simulate", &flight, "--joint", change], 2);
        assert!(parts.iter().all(|part| said.contains(part)), "{said}");
    }
}

/// Columns of a CSV file.
fn columns<const N: usize>(path: &str, names: [&str; N]) -> Vec<[f64; N]> {
    let text = std::fs::read_to_string(path).expect("a table");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let head: Vec<&str> = lines.next().expect("names").split(',').collect();
    let places = names.map(|name| head.iter().position(|own| *own == name).expect(name));
    let row = |line: &str| {
        let cells: Vec<&str> = line.split(',').collect();
        places.map(|place| cells[place].parse().unwrap_or(f64::NAN))
    };
    lines.map(row).collect()
}

/// The reference trajectory of an independent program: from the neutral posture, the arms swing against each other, and the
/// left knee bends and stretches. Here the recording is neutral throughout, and the movements are asked for.
#[test]
fn movements_that_are_asked_for_give_the_reference_trajectory() {
    let (Some(table), Some(file)) = (
        shared("reference/segments.json"),
        reference("trajectory.json"),
    ) else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("run.csv");
    std::fs::copy(table, folder.path().join("segments.json")).expect("copied");
    written(
        folder.path(),
        "subject.toml",
        "height_m = 1.75\nmass_kg = 75\nsex = \"male\"\nsegments = \"segments.json\"\n\
         [coefficients]\ncl = 1.8\ncd = 1.2\ncm = 3.5\ndamp = [3.0, 0.5, 6.0]\nf_arch = 1.055\n",
    );
    let flight = "recording = \"neutral.mvnx\"\nsubject = \"subject.toml\"\n[air]\ndensity = 1.0\n";
    let flight = written(folder.path(), "flight.toml", flight);
    neutral_fall(&folder.path().join("neutral.mvnx"));
    let mut curve = "time_s,arms,knee".to_owned();
    for k in 0..=2400 {
        let time = f64::from(k) / 240.0;
        let swing = (0.25 * (time * core::f64::consts::TAU / 6.0).sin()).to_degrees();
        let _ = write!(curve, "\n{time},{swing},{}", 0.1 * swing);
    }
    let curve = written(folder.path(), "curve.csv", &curve);
    let right = curve.replace("curve.csv", "right.csv");
    let opposite: String = std::fs::read_to_string(&curve)
        .expect("text")
        .lines()
        .skip(1)
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            format!(
                "\n{},{}",
                cells[0],
                -cells[1].parse::<f64>().expect("a number")
            )
        })
        .collect();
    std::fs::write(&right, format!("time_s,arms{opposite}")).expect("written");
    let changes = [
        format!("l_upperarm.phi={curve}:arms"),
        format!("r_upperarm.phi={right}:arms"),
        format!("l_shank.bend={curve}:knee"),
    ];
    let mut arguments = vec![
        "simulate",
        &flight,
        "--start",
        "first",
        "--out",
        plain(&out),
    ];
    for change in &changes {
        arguments.extend(["--joint", change]);
    }
    PROGRAM.json(&arguments);
    let names = [
        "time_s",
        "unchanged_yaw_rate_radps",
        "changed_yaw_rate_radps",
    ];
    let runs = columns(plain(&out), names);
    let mut compared = 0;
    let (mut largest, mut unchanged_most) = (0.0_f64, 0.0_f64);
    let frames = numbers(&file["q_inertial_from_body"]).len() / 4;
    for k in 1..frames {
        let time = 0.05 * k as f64;
        let turned = quaternion(&file["q_inertial_from_body"][k]);
        let expected = (turned * vector(&file["angular_velocity_body"][k])).z;
        let Some([_, unchanged, changed]) = runs.iter().find(|row| (row[0] - time).abs() < 1e-4)
        else {
            continue;
        };
        assert!(
            (changed - expected).abs() < 0.02,
            "{time}: {changed}, expected {expected}"
        );
        unchanged_most = unchanged_most.max(unchanged.abs());
        largest = largest.max(expected.abs());
        compared += 1;
    }
    assert!(
        compared > 190 && largest > 2.0 && unchanged_most < 0.01,
        "{compared} {largest} {unchanged_most}"
    );
}

/// Ten seconds of falling in the neutral posture with the first motion of the reference trajectory.
fn neutral_fall(path: &Path) {
    let description = Description {
        subject_label: "Neutral".to_owned(),
        frame_rate: 240.0,
        start_unix_ms: 0,
        comment: "neutral".to_owned(),
        origin: Origin::Imported { has_places: true },
    };
    let mut writer = Writer::create(path, description, &Subject::default().body()).expect("a file");
    let belly = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::FRAC_PI_2);
    for index in 0..=2400_u32 {
        let time = f64::from(index) / 240.0;
        let frame = FlightFrame {
            index: u64::from(index),
            time,
            posture: pattern::neutral(),
            pelvis: PelvisMotion {
                inertial_from_body: Rotation::from_quaternion(belly),
                position: Vector::new(0.0, 0.0, 4000.0 - 46.0 * time),
                velocity: Some(Vector::new(0.0, 0.0, -46.0)),
                angular_velocity: Some(Vector::zero()),
            },
            centre_of_mass: None,
            bridged: false,
        };
        writer.write(&frame).expect("a frame");
    }
    writer.finish().expect("a file");
}

/// Knees that move in flights of an independent simulator: held still here, they leave away the part of the pitch that their
/// motion gave, so what is then missing in the independent flight is what the change says. The turn rate does not serve: the
/// flights' joints are recorded wrong by a degree or more, which turns the body more than the knees do.
#[test]
fn the_effect_of_knees_on_pitch_is_that_of_an_independent_simulator() {
    let Some(flights) = shared("flights") else {
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let mut products = [0.0, 0.0];
    for (name, number) in ["none-slow-101", "none-mixed-102", "none-wide-103"]
        .into_iter()
        .flat_map(|name| [(name, "flight-0"), (name, "flight-1")])
    {
        let Some(place) = unpacked(
            &folder.path().join(number),
            &flights.join(name).join(number),
        ) else {
            skipped("there is no xz to unpack the flights with");
            return;
        };
        let flight = plain(&place).to_owned();
        let of = |what: &str| plain(&place.join(what)).to_owned();
        PROGRAM.json(&["export", &flight, "--out", &of("frames.csv")]);
        let names = [
            "time_s",
            "l_shank_joint_phi_rad",
            "r_shank_joint_phi_rad",
            "measured_pitch_rad",
        ];
        let rows = columns(&of("frames.csv"), names);
        // The bend is -phi: these curves undo its changes since the first frame.
        let mut curves = "time_s,left,right".to_owned();
        for [time, left, right, _] in &rows {
            let [left, right] = [left - rows[0][1], right - rows[0][2]].map(f64::to_degrees);
            let _ = write!(curves, "\n{time},{left},{right}");
        }
        let curves = written(&place, "curves.csv", &curves);
        let changes = [("l", "left"), ("r", "right")]
            .map(|(side, column)| format!("{side}_shank.bend={curves}:{column}"));
        let run = of("run.csv");
        PROGRAM.json(&[
            "simulate",
            &flight,
            "--joint",
            &changes[0],
            "--joint",
            &changes[1],
            "--out",
            &run,
        ]);
        let runs = columns(&run, ["time_s", "unchanged_pitch_rad", "changed_pitch_rad"]);
        for [time, unchanged, changed] in runs {
            let measured = rows.iter().find(|row| (row[0] - time).abs() < 1e-6);
            let Some([_, _, _, measured]) = measured.filter(|_| time < 2.0) else {
                continue;
            };
            products[0] += (measured - changed) * (unchanged - changed);
            products[1] += (unchanged - changed).powi(2);
        }
        println!("{name}: slope so far {:.2}", products[0] / products[1]);
    }
    let slope = products[0] / products[1];
    assert!((slope - 1.0).abs() < 0.2, "{slope}");
}

/// Unpacks a flight and returns its folder; `None` without `xz`.
fn unpacked(folder: &Path, flight: &Path) -> Option<PathBuf> {
    let place = folder.join(flight.parent()?.file_name()?);
    std::fs::create_dir_all(&place).expect("a folder");
    for name in ["flight.toml", "subject.toml", "segments.json"] {
        std::fs::copy(flight.join(name), place.join(name)).expect("copied");
    }
    let packed = flight.join("flight.mvnx.xz");
    let text = Command::new("xz").arg("-dc").arg(packed).output().ok()?;
    std::fs::write(place.join("flight.mvnx"), text.stdout).expect("written");
    Some(place)
}
