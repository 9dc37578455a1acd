//! The recordings, read from the files as they are published.

use std::path::{Path, PathBuf};

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::imu::stream::Stream;
use bodyflight_mocap::imu::worn::sensors;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use Segment::{
    Abdomen, Head, LeftFoot, LeftForearm, LeftHand, LeftShank, LeftThigh, LeftUpperArm, Pelvis,
    RightFoot, RightForearm, RightHand, RightShank, RightThigh, RightUpperArm, Thorax,
};

/// Attitudes of the segments that the reference knows, to axes with Z up.
pub(super) type Truth = SegmentArray<Option<UnitQuaternion<f64>>>;

/// Sensors with a reference.
pub(super) struct Recording {
    pub(super) sensors: Vec<(Segment, Stream)>,
    /// By the clock of the sensors (s).
    pub(super) truth: Vec<(f64, Truth)>,
    /// A rest before, which shows the biases of raw sensors (s).
    pub(super) rest_s: [f64; 2],
    /// When the person stands upright with the arms down (s).
    pub(super) pose_s: f64,
    /// Time after which errors count (s).
    pub(super) begin_s: f64,
}

/// Numbers that follow each other in a line.
fn numbers(cells: &str, separator: impl Fn(char) -> bool) -> Vec<f64> {
    let cells = cells.split(separator).filter(|cell| !cell.is_empty());
    cells
        .map(|cell| cell.trim().parse().unwrap_or(f64::NAN))
        .collect()
}

fn quaternion(w: f64, x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z))
}

fn about(axis: Vector3<f64>, degrees: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(axis * degrees.to_radians())
}

/// The arm held out to its side, relative to the arm that hangs.
fn held_out(segment: Segment) -> UnitQuaternion<f64> {
    match segment {
        LeftUpperArm | LeftForearm | LeftHand => about(Vector3::y(), -90.0),
        RightUpperArm | RightForearm | RightHand => about(Vector3::y(), 90.0),
        _ => UnitQuaternion::identity(),
    }
}

fn text(file: &Path) -> String {
    assert!(file.is_file(), "{} is missing", file.display());
    std::fs::read_to_string(file).expect("a text")
}

/// Joints of the skeleton of TotalCapture, each with its segment.
const JOINTS: [(Segment, &str); 16] = [
    (Pelvis, "Hips"),
    (Abdomen, "Spine1"),
    (Thorax, "Spine3"),
    (Head, "Head"),
    (LeftUpperArm, "LeftArm"),
    (LeftForearm, "LeftForeArm"),
    (LeftHand, "LeftHand"),
    (RightUpperArm, "RightArm"),
    (RightForearm, "RightForeArm"),
    (RightHand, "RightHand"),
    (LeftThigh, "LeftUpLeg"),
    (LeftShank, "LeftLeg"),
    (LeftFoot, "LeftFoot"),
    (RightThigh, "RightUpLeg"),
    (RightShank, "RightLeg"),
    (RightFoot, "RightFoot"),
];
/// Rate of TotalCapture (Hz).
const TOTAL_CAPTURE: f64 = 60.0;

/// Part "acting3" of subject 5 of TotalCapture: 13 sensors with the orientations of their own fusion, and their specific
/// forces.
pub(super) fn total_capture(folder: &Path) -> Recording {
    let table = text(&folder.join("output_quat_accel.csv"));
    let mut lines = table.lines();
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let place = |name: String| names.iter().position(|other| **other == name);
    let carried = JOINTS
        .into_iter()
        .filter(|(segment, _)| !matches!(segment, Abdomen | LeftHand | RightHand));
    let carried: Vec<(Segment, usize, usize)> = carried
        .map(|(segment, joint)| {
            let column = |what: &str| place(format!("{joint}_{what}")).expect("a column");
            (segment, column("quat"), column("accel"))
        })
        .collect();
    let mut rewritten = String::from("Time");
    let mut mapping = String::from(
        "kind = \"imu\"\n[columns]\ntime = \"Time\"\norientation = [\"w\", \"x\", \"y\", \"z\"]\n\
         specific_force = [\"a\", \"b\", \"c\"]\n",
    );
    for (segment, ..) in &carried {
        let name = segment.name();
        for part in ["w", "x", "y", "z", "a", "b", "c"] {
            rewritten += &format!(",{name}.{part}");
        }
        mapping += &format!("[sensors.{name}]\nprefix = \"{name}.\"\n");
    }
    for (row, line) in lines.enumerate() {
        let cells: Vec<&str> = line.split(',').collect();
        rewritten += &format!("\n{}", row as f64 / TOTAL_CAPTURE);
        for (_, turn, force) in &carried {
            let [turn, force] = [turn, force].map(|at| numbers(cells[*at], |c| c == ' '));
            for part in [
                turn[3], turn[0], turn[1], turn[2], force[0], force[1], force[2],
            ] {
                rewritten += &format!(",{part}");
            }
        }
    }
    let file = written(&rewritten);
    let mapping = ImuMapping::parse(&mapping, Path::new("mapping.toml")).expect("a mapping");
    let sensors = sensors(&mapping, &file).expect("sensors");
    std::fs::remove_file(&file).expect("the table");
    Recording {
        sensors,
        truth: skeleton(&text(&folder.join("gt_skel_gbl_ori.txt"))),
        rest_s: [0.6, 1.6],
        pose_s: 3.0,
        begin_s: 3.5,
    }
}

/// A table in a file of its own.
fn written(table: &str) -> PathBuf {
    let file = std::env::temp_dir().join(format!("bodyflight-{}.csv", std::process::id()));
    std::fs::write(&file, table).expect("a table");
    file
}

/// Attitudes of the skeleton of TotalCapture. Its axes point right, back and down where the person stands with the arms held out;
/// the axes of the room have Y up.
fn skeleton(table: &str) -> Vec<(f64, Truth)> {
    let mut lines = table.lines();
    let names: Vec<&str> = lines
        .next()
        .unwrap_or_default()
        .split_whitespace()
        .collect();
    let level = about(Vector3::x(), 90.0);
    let axes = about(Vector3::y(), 180.0);
    let rows = lines.filter(|line| !line.trim().is_empty());
    let each = rows.enumerate().map(|(row, line)| {
        let read = numbers(line, |c| c == ' ' || c == '\t');
        let truth = SegmentArray::from_fn(|segment| {
            let (_, joint) = JOINTS.iter().find(|(of, _)| *of == segment)?;
            let at = 4 * names.iter().position(|name| name == joint)?;
            let turn = quaternion(read[at + 3], read[at], read[at + 1], read[at + 2]);
            Some(level * turn * axes * held_out(segment))
        });
        (row as f64 / TOTAL_CAPTURE, truth)
    });
    each.collect()
}

/// Sensors of the walk, each with its segment and the name of the segment in the reference.
const LEGS: [(Segment, &str, &str); 5] = [
    (Pelvis, "00B40B91", "RPV"),
    (LeftThigh, "00B40C45", "LTH"),
    (LeftShank, "00B40C44", "LSK"),
    (RightThigh, "00B40C3C", "RTH"),
    (RightShank, "00B40C47", "RSK"),
];

/// The walk of gaittoolbox: raw readings of sensors on pelvis and legs. The reference begins when the person is about to walk.
pub(super) fn walk(folder: &Path) -> Recording {
    let mut mapping = "kind = \"imu\"\nformat = \"mt-manager\"\nrate_hz = 100\n".to_owned();
    for (segment, number, _) in LEGS {
        let name = segment.name();
        mapping += &format!("[sensors.{name}]\nfile = \"imu/S02-Trial-Walk-1-000_{number}.txt\"\n");
    }
    let mapping = ImuMapping::parse(&mapping, Path::new("mapping.toml")).expect("a mapping");
    let sensors = sensors(&mapping, folder).expect("sensors");
    let begin = sensors.first().map_or(0.0, |(_, stream)| stream.span()[0]);
    let table = text(&folder.join("vicon/S02-Trial-Walk-1.csv"));
    let mut lines = table.lines().filter(|line| !line.starts_with("//"));
    let names: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    // Its axes point forwards, left and up.
    let axes = about(Vector3::z(), 90.0);
    // The reference begins with sample 1120 of the sensors.
    let first = begin + 11.19;
    let each = lines.enumerate().map(|(row, line)| {
        let read = numbers(line, |c| c == ',');
        let truth = SegmentArray::from_fn(|segment| {
            let (.., name) = LEGS.iter().find(|(of, ..)| *of == segment)?;
            let column = format!("q{name}_1");
            let at = names.iter().position(|name| *name == column)?;
            let turn = quaternion(read[at], read[at + 1], read[at + 2], read[at + 3]);
            Some(turn * axes)
        });
        (first + row as f64 / 100.0, truth)
    });
    Recording {
        truth: each.collect(),
        sensors,
        rest_s: [begin + 3.0, begin + 10.0],
        pose_s: first,
        begin_s: first + 0.5,
    }
}
