//! Sensors on the limbs by the real binary: from their readings to estimates.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "suit_flights/faults.rs"]
mod faults;
#[path = "suit_flights/slimevr.rs"]
mod slimevr;
#[path = "suit_maneuvers.rs"]
mod suit_maneuvers;

use std::path::{Path, PathBuf};

use bodyflight_core::suit::placement::of_size;
use bodyflight_mvnx::recording::{Options, Recording};
use bodyflight_tests::program::{Program, plain, text};
use nalgebra::Vector3;
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// Time by which the track begins before the flight (s).
const BEFORE: f64 = 4.0;

/// A jump with ten sensors, and what was made of their readings.
struct Jump {
    folder: PathBuf,
    /// What the import said, or why it refused.
    said: String,
    /// Whether there is a flight, and whether it is doubted.
    is_imported: bool,
    is_doubted: bool,
}

impl Jump {
    /// Flies and imports a jump; says when its track began, if that fits at several shifts.
    fn new(folder: &Path, name: &str, seed: u64, fault: Option<&str>) -> Self {
        let jump = folder.join("jump");
        let seed = seed.to_string();
        let mut synth = vec!["synth", name, "--sensors", "10", "--seed", &seed, "--out"];
        synth.push(plain(&jump));
        synth.extend(fault.iter().flat_map(|fault| ["--sensor-fault", fault]));
        let output = PROGRAM.run(&synth);
        assert!(output.status.success(), "{}", text(&output.stderr));
        let mut own = Self {
            folder: folder.to_owned(),
            said: String::new(),
            is_imported: false,
            is_doubted: false,
        };
        if own
            .import()
            .is_some_and(|place| place == "field flight.gnss")
        {
            let mapping = jump.join("sensors/mapping.toml");
            let told = std::fs::read_to_string(&mapping).expect("a mapping");
            let given = told.replace("gnss = ", &format!("gnss_begin_s = {BEFORE:?}\ngnss = "));
            std::fs::write(&mapping, given).expect("a file");
            own.import();
        }
        own
    }

    /// Imports the readings; returns the place of a refusal.
    fn import(&mut self) -> Option<String> {
        let path = |name: &str| plain(&self.folder.join(name)).to_owned();
        let [sensors, map] = ["jump/sensors", "jump/sensors/mapping.toml"].map(path);
        let [subject, out] = ["jump/subject.toml", "suit"].map(path);
        let arguments = [
            "import",
            "--force",
            &sensors,
            "--mapping",
            &map,
            "--subject",
            &subject,
            "--out",
            &out,
            "--json",
        ];
        let output = PROGRAM.run(&arguments);
        let code = output.status.code();
        if let Some(0 | 5) = code {
            let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
            self.said = format!("{} {}", report["doubts"], report["warnings"]);
            (self.is_imported, self.is_doubted) = (true, code == Some(5));
            return None;
        }
        let refusal: Value = serde_json::from_slice(&output.stderr).expect("JSON");
        let error = &refusal["error"];
        let part = |name: &str| error[name].as_str().unwrap_or_default().to_owned();
        self.said = ["place", "message", "help"].map(part).join(" ");
        Some(part("place"))
    }

    /// Estimates it; returns the exit code, what is said, and the rows of the estimates.
    fn estimate(&self) -> (Option<i32>, String, Vec<csv::StringRecord>) {
        let table = self.folder.join("estimates.csv");
        let suit = self.folder.join("suit");
        let output = PROGRAM.run(&["estimate", plain(&suit), "--out", plain(&table), "--force"]);
        let rows = rows(&table);
        (output.status.code(), text(&output.stderr), rows)
    }

    /// Largest error of the direction of a segment with a sensor relative to the pelvis (degrees) at each time (s).
    fn off(&self) -> Vec<(f64, f64)> {
        let frames = |name: &str| {
            let path = self.folder.join(name).join("flight.mvnx");
            let recording = Recording::open(&path, Options::default()).expect("a recording");
            recording.collect::<Result<Vec<_>, _>>().expect("frames")
        };
        let (truth, seen) = (frames("jump"), frames("suit"));
        let limbs = of_size(10).expect("a set");
        let each = seen.iter().step_by(6).filter_map(|seen| {
            let after = truth.partition_point(|frame| frame.time <= seen.time + 1e-6);
            let turns = [truth.get(after.checked_sub(1)?)?, seen]
                .map(|frame| frame.posture.body_from_segments());
            let angle = limbs.iter().map(|segment| {
                let [one, other] = [0, 1].map(|of| turns[of][*segment] * Vector3::z());
                one.angle(&other).to_degrees()
            });
            Some((seen.time, angle.fold(0.0, f64::max)))
        });
        each.collect()
    }
}

/// The rows of a table, whose first is the names of the columns.
fn rows(path: &Path) -> Vec<csv::StringRecord> {
    let reader = csv::ReaderBuilder::new().has_headers(false).from_path(path);
    let rows = reader.expect("a table").into_records();
    rows.collect::<Result<_, _>>().expect("rows")
}

/// The column of a table.
fn column(rows: &[csv::StringRecord], name: &str) -> Vec<String> {
    let place = rows[0].iter().position(|own| own == name);
    let place = place.expect("a known column");
    rows[1..].iter().map(|row| row[place].to_owned()).collect()
}

fn numbers(rows: &[csv::StringRecord], name: &str) -> Vec<f64> {
    let cells = column(rows, name).into_iter();
    cells.map(|cell| cell.parse().expect("a number")).collect()
}

/// The limb groups go with the sensors: an input of others has another meaning, even another sign.
#[test]
fn inputs_of_a_suit_are_those_of_the_limb_groups_that_were_flown() {
    let folder = tempfile::tempdir().expect("a folder");
    let jump = Jump::new(folder.path(), "back-loop", 4101, None);
    assert!(!jump.is_doubted, "{}", jump.said);
    let (_, said, rows) = jump.estimate();
    let truth = crate::rows(&folder.path().join("jump/inputs.csv"));
    let (times, flown) = (numbers(&truth, "time_s"), numbers(&truth, "pitch"));
    let (found, deviation) = (numbers(&rows, "pitch"), numbers(&rows, "sd_pitch"));
    let inside = numbers(&rows, "time_s").into_iter().enumerate();
    let inside = inside.filter(|(place, time)| {
        let after = times.partition_point(|own| own <= time).max(1);
        (found[*place] - flown[after - 1]).abs() <= 2.0 * deviation[*place]
    });
    let share = inside.count() as f64 / found.len() as f64;
    assert!(share > 0.95, "{share}: {said}");
}

/// What the import doubts, no estimate is sure of: a sensor that the import names, or a posture that nobody takes.
#[test]
fn a_doubted_sensor_keeps_estimates_from_being_consistent() {
    for (seed, fault, told) in [
        (4103, "l_thigh:reversed=3", "l_thigh"),
        (5300, "l_upperarm:reversed=3", "the elbows are folded flat"),
    ] {
        let folder = tempfile::tempdir().expect("a folder");
        let jump = Jump::new(folder.path(), "layouts", seed, Some(fault));
        assert!(jump.is_doubted && jump.said.contains(told), "{}", jump.said);
        let (code, said, rows) = jump.estimate();
        assert_eq!(code, Some(5), "{said}");
        let said = said.split_whitespace().collect::<Vec<_>>().join(" ");
        assert!(said.contains(told), "{said}");
        let states = column(&rows, "consistency");
        assert!(states.iter().all(|state| state != "consistent"), "{fault}");
    }
}

/// A recording of attitudes alone, as from OpenSense or a BVH file without a path, has no velocity that would tell when a
/// receiver's track began: that is asked for.
#[test]
fn a_recording_without_velocity_takes_a_receivers_track() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut jump = Jump::new(folder.path(), "exit-and-tracking", 4104, None);
    let mapping = folder.path().join("jump/sensors/mapping.toml");
    let told = std::fs::read_to_string(&mapping).expect("a mapping");
    let blind = told.lines().filter(|line| !line.starts_with("gnss"));
    let blind = blind.collect::<Vec<_>>().join("\n");
    std::fs::write(&mapping, blind).expect("a file");
    std::fs::remove_dir_all(folder.path().join("suit")).expect("a folder");
    assert_eq!(jump.import(), None);
    let flight = folder.path().join("suit/flight.toml");
    let without = std::fs::read_to_string(&flight).expect("a flight");
    let suit = plain(&folder.path().join("suit")).to_owned();
    let with = |more: &str| {
        let text = format!("gnss = \"../jump/sensors/TRACK.CSV\"\n{more}{without}");
        std::fs::write(&flight, text).expect("a file");
    };
    with("");
    let asked = PROGRAM.fails(&["estimate", &suit], 2);
    assert!(asked.contains("gnss_begin_s"), "{asked}");
    with("gnss_begin_s = 400.0\n");
    let late = PROGRAM.fails(&["estimate", &suit], 2);
    assert!(late.contains("does not cover"), "{late}");
    with(&format!("gnss_begin_s = {BEFORE:?}\n"));
    let output = PROGRAM.run(&["estimate", &suit, "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let apart = report["rms"]["vertical_velocity_mps"].as_f64();
    assert!(apart < Some(1.0), "{report}");
    assert!(report["assumed_velocity_sd_mps"].is_null(), "{report}");
}
