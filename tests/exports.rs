//! Exports through the real binary, read back as other programs would.
#![expect(clippy::unwrap_used, reason = "tests may panic: that is how they fail")]

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_tests::program::{Program, number, plain};
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

/// Columns of a CSV file by name; empty fields become NaN.
fn table(path: &Path) -> BTreeMap<String, Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        for (column, field) in columns.iter_mut().zip(line.split(',')) {
            column.push(field.parse().unwrap_or(f64::NAN));
        }
    }
    let names = names.into_iter().map(str::to_owned);
    names.zip(columns).collect()
}

/// Whether two numbers agree to within the rounding of a file with the resolution `step`, or both are missing.
fn is_near(a: f64, b: f64, step: f64) -> bool {
    (a - b).abs() <= 0.51 * step || (a.is_nan() && b.is_nan())
}

#[test]
fn a_table_agrees_with_simulate_and_the_air_carries_the_weight() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flight = PROGRAM.synth("aggressive-turns", &at("flight"), &["--seed", "3"]);
    let (out, run) = (at("run.csv"), at("simulated.csv"));
    let report = PROGRAM.json(&["export", &flight, "--out", plain(&out)]);
    PROGRAM.json(&["simulate", &flight, "--out", plain(&run)]);
    let (exported, simulated) = (table(&out), table(&run));
    assert_eq!(report["columns"], exported.len());
    for (name, column) in &simulated {
        let ours = exported.get(name).unwrap_or_else(|| panic!("no {name}"));
        // `simulate` does not write the first frame, where the run starts.
        assert_eq!(ours.len(), column.len() + 1);
        for (a, b) in ours.iter().skip(1).zip(column) {
            assert!(is_near(*a, *b, 1e-6), "{name}: {a} and {b}");
        }
    }
    // At terminal speed the forces on all segments carry the weight.
    let rows = exported["time_s"].len();
    let mean_lift: f64 = (0..rows)
        .map(|row| {
            let sum = |part: &str| -> f64 {
                let of_part = exported
                    .iter()
                    .filter(|(name, _)| name.ends_with(&format!("_force_{part}_n")));
                of_part.map(|(_, column)| column[row]).sum()
            };
            let [w, x, y, z] = ["w", "x", "y", "z"]
                .map(|part| exported[&format!("simulated_attitude_{part}")][row]);
            // Third row of the quaternion's rotation matrix.
            let up = [
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ];
            up[0] * sum("left") + up[1] * sum("dorsal") + up[2] * sum("cranial")
        })
        .sum::<f64>()
        / rows as f64;
    let trim = PROGRAM.json(&["trim"]);
    let weight = number(&trim["mass_kg"]) * 9.81;
    assert!(
        (mean_lift / weight - 1.0).abs() < 0.1,
        "{mean_lift}, {weight}"
    );
}

/// Messages of a topic as JSON, with their times (s).
fn messages(bytes: &[u8], topic: &str) -> Vec<(f64, Value)> {
    let all = mcap::MessageStream::new(bytes).unwrap();
    let messages = all.map(|message| message.unwrap());
    let of_topic = messages.filter(|message| message.channel.topic == topic);
    let read = |message: mcap::Message<'_>| {
        assert_eq!(message.channel.message_encoding, "json");
        let schema = message.channel.schema.clone().unwrap();
        assert_eq!(schema.encoding, "jsonschema");
        serde_json::from_slice::<Value>(&schema.data).unwrap();
        let time = message.log_time as f64 * 1e-9;
        (time, serde_json::from_slice(&message.data).unwrap())
    };
    of_topic.map(read).collect()
}

#[test]
fn a_body_moves_in_foxglove_as_the_table_says() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flight = PROGRAM.synth("rotations", &at("flight"), &[]);
    let (out, csv) = (at("run.mcap"), at("run.csv"));
    PROGRAM.json(&["export", &flight, "--out", plain(&out)]);
    PROGRAM.json(&["export", &flight, "--out", plain(&csv)]);
    let (bytes, table) = (std::fs::read(&out).unwrap(), table(&csv));
    let frames = table["time_s"].len();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let schemas: Vec<&str> = summary
        .schemas
        .values()
        .map(|schema| schema.name.as_str())
        .collect();
    for name in ["FrameTransforms", "SceneUpdate", "PoseInFrame"] {
        assert!(
            schemas.contains(&&*format!("foxglove.{name}")),
            "{schemas:?}"
        );
    }
    let numbers = messages(&bytes, "/flight");
    assert_eq!(numbers.len(), frames);
    for (row, (time, message)) in numbers.iter().enumerate() {
        assert!(is_near(*time, table["time_s"][row], 1e-8));
        for (name, value) in message.as_object().unwrap() {
            let value = value.as_f64().unwrap_or(f64::NAN);
            assert!(is_near(value, table[name][row], 1e-9), "{name}: {value}");
        }
    }
    let transforms = messages(&bytes, "/tf");
    assert_eq!(transforms.len(), frames);
    let (_, last) = transforms.last().unwrap();
    let all = last["transforms"].as_array().unwrap();
    assert_eq!(all.len(), 32);
    for transform in all {
        assert_eq!(transform["parent_frame_id"], "world");
        let child = transform["child_frame_id"].as_str().unwrap();
        let (side, segment) = child.split_once('/').unwrap();
        for (axis, part) in [("x", "north"), ("y", "west"), ("z", "up")] {
            let wanted = table[&format!("{segment}_{side}_position_{part}_m")][frames - 1];
            let found = number(&transform["translation"][axis]);
            assert!(is_near(found, wanted, 1e-9), "{child} {axis}: {found}");
        }
        for axis in ["w", "x", "y", "z"] {
            let wanted = table[&format!("{segment}_{side}_attitude_{axis}")][frames - 1];
            assert!(is_near(number(&transform["rotation"][axis]), wanted, 1e-9));
        }
    }
    let solids = messages(&bytes, "/body");
    assert_eq!(solids.len(), 1);
    let entities = solids[0].1["entities"].as_array().unwrap();
    assert!(entities.iter().all(|entity| entity["frame_locked"] == true));
    assert_eq!(entities.len(), 32);
    let of_hand = &messages(&bytes, "/segments")[frames / 2].1["l_hand"];
    let force = number(&of_hand["force_dorsal_n"]);
    assert!(is_near(
        force,
        table["l_hand_force_dorsal_n"][frames / 2],
        1e-9
    ));
    assert!(!messages(&bytes, "/forces").is_empty());
}

#[test]
fn estimates_stand_beside_the_frames_from_their_times_on() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flight = PROGRAM.synth("rotations", &at("flight"), &[]);
    let (out, found) = (at("run.csv"), at("found.csv"));
    let arguments = ["export", &flight, "--out", plain(&out), "--estimates"];
    let (report, code) = PROGRAM.answer(&arguments);
    let (_, wanted) = PROGRAM.answer(&["estimate", &flight, "--out", plain(&found)]);
    assert_eq!(code, wanted, "{report}");
    assert_eq!(code == Some(5), !report["doubt"].is_null(), "{report}");
    let (exported, estimated) = (table(&out), table(&found));
    let at_row = |time: f64| {
        let times = &exported["time_s"];
        times.iter().position(|t| *t >= time - 1e-5).unwrap()
    };
    assert!(exported["estimated_pitch"][0].is_nan());
    for (k, time) in estimated["time_s"].iter().enumerate() {
        let row = at_row(*time);
        for name in ["pitch", "damp_roll", "sd_yaw", "sd_damp_pitch", "nis"] {
            let ours = exported[&format!("estimated_{name}")][row];
            assert!(is_near(ours, estimated[name][k], 1e-6), "{name} at {time}");
        }
        let residual = exported["estimated_residual_dorsal_m2"][row];
        assert!(is_near(residual, estimated["residual_dorsal_m2"][k], 1e-9));
    }
}

#[test]
fn nothing_is_replaced_without_force_and_names_select_the_format() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flight = PROGRAM.synth("rotations", &at("flight"), &[]);
    let out = at("run.npz");
    let arguments = ["export", &flight, "--out", plain(&out)];
    let report = PROGRAM.json(&arguments);
    assert_eq!(report["format"], "npz");
    assert!(PROGRAM.fails(&arguments, 2).contains("--force"));
    PROGRAM.json(&[&arguments[..], &["--force"]].concat());
    let recording = at("flight/flight.mvnx");
    let over = ["export", &flight, "--format", "csv", "--force", "--out"];
    let message = PROGRAM.fails(&[&over[..], &[plain(&recording)]].concat(), 2);
    assert!(message.contains("would be overwritten"), "{message}");
    let message = PROGRAM.fails(&["export", &flight, "--out", plain(&at("run.xlsx"))], 2);
    assert!(message.contains(".parquet"), "{message}");
    PROGRAM.fails(&["export", &flight], 2);
}
