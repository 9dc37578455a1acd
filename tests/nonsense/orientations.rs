//! Files of sensors that only know how they are turned: Xsens DOT, MT Manager, OpenSense.

use core::fmt::Write;
use std::fs;
use std::path::Path;

use bodyflight_core::{Posture, Segment};
use bodyflight_mvnx::xsens;
use bodyflight_tests::opensense_name;
use nalgebra::{Quaternion, UnitQuaternion, Vector3};

use super::imports::SEGMENTS;
use super::recorded::Frame;
use super::{bodyflight, kind, part, recorded, rows};

/// Frames of the recording from one row to the next: 60 rows a second.
const STEP: usize = 4;

/// A sensor: the names of its columns, and its rows cell by cell, of which the first two are counter and time (us).
struct Sensor {
    name: &'static str,
    header: String,
    columns: Vec<&'static str>,
    rows: Vec<Vec<String>>,
}

/// How a system writes its sensors.
enum System {
    Dot,
    MtManager,
    OpenSense,
}

/// A kind of nonsense.
struct Turned {
    name: &'static str,
    system: System,
    change: fn(&mut [Sensor]),
}

const fn dot(name: &'static str, change: fn(&mut [Sensor])) -> Turned {
    Turned {
        name,
        system: System::Dot,
        change,
    }
}

const fn mt(name: &'static str, change: fn(&mut [Sensor])) -> Turned {
    Turned {
        name,
        system: System::MtManager,
        change,
    }
}

const fn sto(name: &'static str, change: fn(&mut [Sensor])) -> Turned {
    Turned {
        name,
        system: System::OpenSense,
        change,
    }
}

fn of<'a>(sensors: &'a mut [Sensor], name: &str) -> &'a mut Sensor {
    let found = sensors.iter_mut().find(|sensor| sensor.name == name);
    found.expect("a sensor")
}

/// Exchanges the numbers of each row.
fn reordered(sensors: &mut [Sensor], order: [usize; 4]) {
    for row in sensors.iter_mut().flat_map(|sensor| &mut sensor.rows) {
        let turn = order.map(|part| row[2 + part].clone());
        row.truncate(2);
        row.extend(turn);
    }
}

/// Puts the numbers of other rows of the same sensor in place.
fn retimed(sensor: &mut Sensor, from: impl Fn(usize) -> usize) {
    let turns: Vec<Vec<String>> = sensor.rows.iter().map(|row| row[2..].to_vec()).collect();
    for (k, row) in sensor.rows.iter_mut().enumerate() {
        row.truncate(2);
        row.extend(turns[from(k)].clone());
    }
}

/// The numbers of one sensor for another too.
fn copied(sensors: &mut [Sensor], from: &str, to: &str) {
    let rows = of(sensors, from).rows.clone();
    of(sensors, to).rows = rows;
}

fn scaled(sensors: &mut [Sensor], factors: [f64; 4]) {
    for row in sensors.iter_mut().flat_map(|sensor| &mut sensor.rows) {
        for (cell, factor) in row[2..].iter_mut().zip(factors) {
            let number: f64 = cell.parse().expect("a number");
            *cell = format!("{:.6}", factor * number);
        }
    }
}

fn quaternion(row: &[String]) -> UnitQuaternion<f64> {
    let number = |k: usize| row[2 + k].parse().expect("a number");
    UnitQuaternion::new_normalize(Quaternion::new(number(0), number(1), number(2), number(3)))
}

fn nothing(_: &mut [Sensor]) {}
fn w_last(all: &mut [Sensor]) {
    reordered(all, [1, 2, 3, 0]);
}
fn inverse(all: &mut [Sensor]) {
    scaled(all, [1.0, -1.0, -1.0, -1.0]);
}
fn twice_as_long(all: &mut [Sensor]) {
    scaled(all, [2.0; 4]);
}
fn one_for_both_thighs(all: &mut [Sensor]) {
    copied(all, "r_thigh", "l_thigh");
}
fn at_half_the_rate(all: &mut [Sensor]) {
    retimed(of(all, "l_forearm"), |k| k - k % 2);
}
fn no_numbers(all: &mut [Sensor]) {
    of(all, "l_shank").rows[100][3] = "NaN".to_owned();
}

/// All kinds.
const TURNED: [Turned; 27] = [
    dot("DOT: nothing", nothing),
    dot("DOT: w last", w_last),
    dot("DOT: y and z exchanged", |all| reordered(all, [0, 1, 3, 2])),
    dot("DOT: inverse", inverse),
    dot("DOT: quaternions of length 2", twice_as_long),
    dot("DOT: Euler angles in radians", |all| {
        for sensor in all {
            sensor.columns = vec!["Euler_X", "Euler_Y", "Euler_Z"];
            for row in &mut sensor.rows {
                let (roll, pitch, yaw) = quaternion(row).euler_angles();
                row.truncate(2);
                row.extend([roll, pitch, yaw].map(|angle| format!("{angle:.6}")));
            }
        }
    }),
    dot("DOT: a sensor at half the rate", at_half_the_rate),
    dot("DOT: a sample in thirty lost and filled", |all| {
        retimed(
            of(all, "l_forearm"),
            |k| if k % 30 == 7 { k - 1 } else { k },
        );
    }),
    dot("DOT: a sensor for both thighs", one_for_both_thighs),
    dot("DOT: a sensor for upper arm and forearm", |all| {
        copied(all, "r_upperarm", "r_forearm");
    }),
    dot("DOT: a sensor on the table", |all| {
        retimed(of(all, "head"), |k| k % 2);
        let head = of(all, "head");
        for (k, row) in head.rows.iter_mut().enumerate() {
            row[2] = "1".to_owned();
            let noise = |k: usize| format!("{:.6}", 0.002 * (k as f64).sin());
            (row[3], row[4], row[5]) = (noise(k), noise(2 * k), noise(k * k));
        }
    }),
    dot("DOT: a sensor frozen for 3 s", |all| {
        retimed(of(all, "r_shank"), |k| if k < 300 { k.min(120) } else { k });
    }),
    dot("DOT: heading of a sensor jumps", |all| {
        for row in &mut of(all, "l_shank").rows[241..] {
            let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * 0.8) * quaternion(row);
            row.truncate(2);
            row.extend([turn.w, turn.i, turn.j, turn.k].map(|part| format!("{part:.6}")));
        }
    }),
    dot("DOT: thigh and shank exchanged", |all| {
        let thigh = of(all, "l_thigh").rows.clone();
        copied(all, "l_shank", "l_thigh");
        of(all, "l_shank").rows = thigh;
    }),
    dot("DOT: no numbers", no_numbers),
    dot("DOT: half a second missing", |all| {
        for sensor in all {
            sensor.rows.drain(200..230);
        }
    }),
    dot("DOT: half a second backwards", |all| {
        of(all, "l_shank").rows[200..230].reverse();
    }),
    dot("DOT: a column without a name", |all| {
        for row in &mut of(all, "l_shank").rows {
            row.push("0".to_owned());
        }
    }),
    dot("DOT: clock of a sensor twice as fast", |all| {
        for (k, row) in of(all, "l_shank").rows.iter_mut().enumerate() {
            row[1] = format!("{}", 1_000_000 + k * 1_000_000 / 120);
        }
    }),
    mt("MT Manager: nothing", nothing),
    mt("MT Manager: a rate of 100 Hz in the header", |all| {
        for sensor in all {
            sensor.header = sensor.header.replace("60.0Hz", "100.0Hz");
        }
    }),
    mt("MT Manager: w last", w_last),
    sto("OpenSense: nothing", nothing),
    sto("OpenSense: a rate of 100 Hz in the header", |all| {
        all[0].header = all[0].header.replace("60.0", "100.0");
    }),
    sto("OpenSense: quaternions of length 2", twice_as_long),
    sto("OpenSense: a sensor at half the rate", at_half_the_rate),
    sto("OpenSense: a sensor for both thighs", one_for_both_thighs),
];

/// The sensors of a recording, each turned anyhow on its segment, after a row in which the person stands. Then this axis of
/// that on the pelvis points forwards.
fn sensors(frames: &[Frame], forward: &Vector3<f64>) -> Vec<Sensor> {
    let still = Posture::h_pose().body_from_segments();
    let facing = *xsens::facing_forward().quaternion();
    let rows = |name: &str, at: usize| {
        let segment = Segment::from_name(name).expect("a segment");
        let mounted = match segment {
            Segment::Pelvis => {
                UnitQuaternion::rotation_between(forward, &Vector3::x()).expect("not opposite")
            }
            _ => UnitQuaternion::from_scaled_axis(Vector3::new(0.4, at as f64, -0.9)),
        };
        let own = *xsens::xsens_from_segment(segment).quaternion();
        let first = facing * still[segment] * own.inverse();
        let flown = frames.iter().step_by(STEP).map(|frame| {
            let [w, x, y, z] = frame.orientation[at];
            UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z))
        });
        let rows = core::iter::once(first)
            .chain(flown)
            .enumerate()
            .map(|(k, turn)| {
                let turn = turn * mounted;
                let mut row = vec![
                    format!("{}", k + 1),
                    format!("{}", 1_000_000 + k * 1_000_000 / 60),
                ];
                row.extend([turn.w, turn.i, turn.j, turn.k].map(|part| format!("{part:.6}")));
                row
            });
        rows.collect()
    };
    let worn = SEGMENTS.iter().filter(|(name, _)| *name != "abdomen");
    worn.map(|(name, at)| Sensor {
        name,
        header: String::new(),
        columns: Vec::new(),
        rows: rows(name, *at),
    })
    .collect()
}

impl Turned {
    /// Writes the changed sensors, and returns the arguments with which they are imported.
    fn written(&self, frames: &[Frame], folder: &Path) -> Vec<String> {
        // Without a mapping, it is that of OpenSense's examples.
        let forward = match self.system {
            System::OpenSense => Vector3::z(),
            System::Dot | System::MtManager => Vector3::x(),
        };
        let mut all = sensors(frames, &forward);
        for sensor in &mut all {
            (sensor.header, sensor.columns) = match self.system {
                System::Dot => (
                    format!("DeviceTag:,{}\n", sensor.name),
                    vec!["Quat_W", "Quat_X", "Quat_Y", "Quat_Z"],
                ),
                System::MtManager => (
                    "// Start Time: Unknown\n// Update Rate: 60.0Hz\n".to_owned(),
                    vec!["Quat_q0", "Quat_q1", "Quat_q2", "Quat_q3"],
                ),
                System::OpenSense => (
                    "DataRate=60.0\nDataType=Quaternion\nversion=3\nOpenSimVersion=4.4\nendheader\n"
                        .to_owned(),
                    Vec::new(),
                ),
            };
        }
        (self.change)(&mut all);
        let at = folder.join("worn");
        let _ = fs::remove_dir_all(&at);
        fs::create_dir(&at).expect("a folder");
        if matches!(self.system, System::OpenSense) {
            let path = at.join("worn.sto");
            fs::write(&path, opensense(&all)).expect("written");
            return vec![path.to_str().expect("plain").to_owned()];
        }
        let is_dot = matches!(self.system, System::Dot);
        for sensor in &all {
            let (separator, name) = match is_dot {
                true => (",", format!("{}.csv", sensor.name)),
                false => (
                    "\t",
                    format!("MT_0120-{}.txt", sensor.name.replace('_', "-")),
                ),
            };
            let mut text = sensor.header.clone();
            let names = [
                &["PacketCounter", "SampleTimeFine"],
                sensor.columns.as_slice(),
            ]
            .concat();
            let _ = writeln!(text, "{}", names.join(separator));
            for row in &sensor.rows {
                let mut row = row.clone();
                if !is_dot {
                    // It counts tenths of a millisecond.
                    let digits = row[1].len() - 2;
                    row[1].truncate(digits);
                }
                let _ = writeln!(text, "{}", row.join(separator));
            }
            fs::write(at.join(name), text).expect("written");
        }
        let map = folder.join("worn.toml");
        fs::write(&map, mapping(&all, is_dot)).expect("written");
        let [at, map] = [at, map].map(|path| path.to_str().expect("plain").to_owned());
        vec![at, "--mapping".to_owned(), map]
    }
}

fn mapping(all: &[Sensor], is_dot: bool) -> String {
    let mut text = "kind = \"quaternions\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n\
        [body]\naxes = [\"forward\", \"left\", \"up\"]\nrest = \"h-pose\"\n[time]\ncolumn = \"Time\"\n\
        [quaternions]\nmounting = \"first-row\"\nforward = \"x\"\n"
        .to_owned();
    for Sensor { name, .. } in all {
        let tag = match is_dot {
            true => (*name).to_owned(),
            false => format!("0120-{}", name.replace('_', "-")),
        };
        let _ = write!(text, "[segments.{name}]\ncolumns = [\"{tag}\"]\n");
    }
    text
}

/// One file with all sensors, as OpenSense has it.
fn opensense(all: &[Sensor]) -> String {
    let mut text = all[0].header.clone() + "time";
    for sensor in all {
        let _ = write!(text, "\t{}", opensense_name(sensor.name));
    }
    for (k, row) in all[0].rows.iter().enumerate() {
        let time: f64 = row[1].parse().expect("a time");
        let _ = write!(text, "\n{:.6}", 1e-6 * (time - 1e6));
        for sensor in all {
            let _ = write!(text, "\t{}", sensor.rows[k][2..].join(","));
        }
    }
    text + "\n"
}

#[test]
fn import_is_not_silent_about_sensors_that_only_know_how_they_are_turned() {
    let page = part(6);
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let frames = recorded.changed(kind("nothing").expect("a kind"));
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let (subject, out) = (at("good/subject.toml"), at("out"));
    let mut wrong = Vec::new();
    let all = rows(&page);
    let names: Vec<&str> = all.iter().map(|row| row[0]).collect();
    assert_eq!(names, TURNED.map(|kind| kind.name));
    for (row, kind) in all.iter().zip(&TURNED) {
        let own = kind.written(&frames, folder.path());
        let mut arguments = vec!["--json", "import"];
        arguments.extend(own.iter().map(String::as_str));
        arguments.extend(["--subject", &subject, "--out", &out, "--force"]);
        let (said, ended) = bodyflight(&arguments);
        let is_told = said.contains(row[1]) && (ended != Some(5) || said.contains("\"doubts\""));
        if ended != row[2].parse().ok() || !is_told {
            wrong.push(format!("{}: ends with {ended:?}: {said}", kind.name));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
