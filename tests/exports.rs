//! Exports through the real binary, read back as other programs would.
#![expect(clippy::unwrap_used, reason = "tests may panic: that is how they fail")]

use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

use bodyflight_tests::program::{Program, number, plain};
use lz4_flex::frame::FrameDecoder;
use mcap::records::Record;
use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use parquet::file::reader::FileReader;
use prost_reflect::{DescriptorPool, DynamicMessage, SerializeOptions};
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

/// A message of a topic: its time (s), and its fields as JSON.
type Told = (f64, Value);

/// Messages of a topic from each that is read to the next.
const EVERY: usize = 16;

/// Messages of a file by topic, one of [`EVERY`], read by the descriptions in the file alone; and how many there are.
fn messages(bytes: &[u8]) -> (BTreeMap<String, Vec<Told>>, BTreeMap<String, usize>) {
    let summary = mcap::Summary::read(bytes).unwrap().unwrap();
    let stated = summary.stats.as_ref().unwrap().message_count;
    let mut topics: BTreeMap<String, Vec<Told>> = BTreeMap::new();
    let mut counts: BTreeMap<String, usize> = BTreeMap::new();
    let mut types = BTreeMap::new();
    for (id, channel) in &summary.channels {
        assert_eq!(channel.message_encoding, "protobuf");
        let schema = channel.schema.as_ref().unwrap();
        assert_eq!(schema.encoding, "protobuf");
        let pool = DescriptorPool::decode(schema.data.as_ref()).unwrap();
        let of = pool.get_message_by_name(&schema.name).unwrap();
        types.insert(*id, (channel.topic.clone(), of));
    }
    let as_is = SerializeOptions::new()
        .use_proto_field_name(true)
        .skip_default_fields(false);
    for record in mcap::read::LinearReader::new(bytes).unwrap() {
        let Record::Chunk { mut header, data } = record.unwrap() else {
            continue;
        };
        // The reader decompresses by C libraries only, so it gets the chunk without compression; it checks the sums.
        assert_eq!(header.compression, "lz4");
        let mut plain = Vec::new();
        FrameDecoder::new(&data[..])
            .read_to_end(&mut plain)
            .unwrap();
        header.compression.clear();
        header.compressed_size = header.uncompressed_size;
        for record in mcap::read::ChunkReader::new(header, &plain).unwrap() {
            let Record::Message { header, data } = record.unwrap() else {
                continue;
            };
            let (topic, of) = &types[&header.channel_id];
            let count = counts.entry(topic.clone()).or_default();
            assert_eq!(header.sequence as usize, *count);
            *count += 1;
            if !(*count - 1).is_multiple_of(EVERY) {
                continue;
            }
            let message = DynamicMessage::decode(of.clone(), data.as_ref()).unwrap();
            assert_eq!(message.unknown_fields().count(), 0, "{topic}");
            let json = message
                .serialize_with_options(serde_json::value::Serializer, &as_is)
                .unwrap();
            let topic = topics.entry(topic.clone()).or_default();
            topic.push((header.log_time as f64 * 1e-9, json));
        }
    }
    let found: usize = counts.values().sum();
    assert_eq!(found as u64, stated);
    (topics, counts)
}

/// Twice the relative resolution of 32 bits, since JSON rounds once more.
const ROUNDED: f64 = 2.0 * f32::EPSILON as f64;

/// A number of a message; missing ones are NaN.
fn told(value: &Value) -> f64 {
    value.as_f64().unwrap_or(f64::NAN)
}

/// The pose of each frame in the world, by its name.
fn in_world(transforms: &Value) -> BTreeMap<String, Isometry3<f64>> {
    let mut poses = BTreeMap::from([("world".to_owned(), Isometry3::identity())]);
    for transform in transforms["transforms"].as_array().unwrap() {
        let [x, y, z] = ["x", "y", "z"].map(|axis| told(&transform["translation"][axis]));
        let turn = ["w", "x", "y", "z"].map(|axis| told(&transform["rotation"][axis]));
        let turn = Quaternion::new(turn[0], turn[1], turn[2], turn[3]);
        let pose = Isometry3::from_parts(
            Translation3::new(x, y, z),
            UnitQuaternion::from_quaternion(turn),
        );
        let parent = poses[transform["parent_frame_id"].as_str().unwrap()];
        let child = transform["child_frame_id"].as_str().unwrap().to_owned();
        poses.insert(child, parent * pose);
    }
    poses
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
    // Half a minute at 240 Hz takes at most 15 MB.
    assert!(bytes.len() / frames * 7200 < 15_000_000, "{}", bytes.len());
    let (topics, counts) = messages(&bytes);
    for (place, (time, message)) in topics["/flight"].iter().enumerate() {
        let row = EVERY * place;
        assert!(is_near(*time, table["time_s"][row], 1e-8));
        for (name, value) in message.as_object().unwrap() {
            let (found, wanted) = (told(value), table[name][row]);
            // Places and times are exact, other numbers are in 32 bits.
            let is_wide = name.ends_with("_m") || name == "time_s";
            let rounded = if is_wide { 0.0 } else { ROUNDED };
            assert!(
                is_near(found, wanted, wanted.abs() * rounded),
                "{name}: {found}"
            );
        }
    }
    assert_eq!(counts["/flight"], frames);
    // Poses come at 60 Hz.
    assert_eq!(counts["/tf"], (frames - 1) / 4 + 1);
    for (place, (time, transforms)) in topics["/tf"].iter().enumerate().step_by(7) {
        let row = 4 * EVERY * place;
        assert!(is_near(*time, table["time_s"][row], 1e-8));
        let poses = in_world(transforms);
        assert_eq!(poses.len(), 33);
        for (frame, pose) in poses {
            let Some((side, segment)) = frame.split_once('/') else {
                continue;
            };
            let wanted = |name: &str| table[&format!("{segment}_{side}_{name}")][row];
            let place = pose.translation.vector;
            for (part, found) in ["north", "west", "up"].into_iter().zip(&place) {
                let wanted = wanted(&format!("position_{part}_m"));
                assert!(is_near(*found, wanted, 1e-9), "{frame} {part}: {found}");
            }
            let [w, x, y, z] = ["w", "x", "y", "z"].map(|k| wanted(&format!("attitude_{k}")));
            let wanted = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
            assert!(pose.rotation.angle_to(&wanted) < 1e-7, "{frame}");
        }
        let (_, pelvis) = &topics["/simulated/pose"][place];
        let height = told(&pelvis["pose"]["position"]["z"]);
        assert!(is_near(
            height,
            table["simulated_position_up_m"][row],
            1e-15
        ));
        for (segment, numbers) in topics["/segments"][4 * place].1.as_object().unwrap() {
            for (name, number) in numbers.as_object().unwrap() {
                let wanted = table[&format!("{segment}_{name}")][row];
                let rounded = wanted.abs() * ROUNDED;
                assert!(is_near(told(number), wanted, rounded), "{segment} {name}");
            }
        }
    }
    let [(_, solids)] = topics["/body"].as_slice() else {
        panic!("{} messages", topics["/body"].len());
    };
    let entities = solids["entities"].as_array().unwrap();
    assert!(entities.iter().all(|entity| entity["frame_locked"] == true));
    assert_eq!(entities.len(), 32);
    let arrows = &topics["/forces"][0].1["entities"][0]["arrows"];
    assert_eq!(arrows.as_array().unwrap().len(), 16);
}

#[test]
fn a_file_says_whose_flight_it_is_and_when_it_was_recorded() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let flight = PROGRAM.synth("rotations", &at("flight"), &[]);
    let recording = at("flight/flight.mvnx");
    let text = std::fs::read_to_string(&recording).unwrap();
    // Frames with Unix times, as MVN writes them.
    let mut parts = text.split(" ms=\"");
    let mut timed = parts.next().unwrap().to_owned();
    for part in parts {
        let (milliseconds, rest) = part.split_once('"').unwrap();
        let milliseconds: u64 = milliseconds.parse().unwrap();
        timed += &format!(" ms=\"{}\"{rest}", 1_542_082_631_842 + milliseconds);
    }
    std::fs::write(&recording, timed).unwrap();
    let (out, table) = (at("run.mcap"), at("run.parquet"));
    PROGRAM.json(&["export", &flight, "--out", plain(&out)]);
    PROGRAM.json(&["export", &flight, "--out", plain(&table)]);
    let bytes = std::fs::read(&out).unwrap();
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let began = summary.stats.as_ref().unwrap().message_start_time;
    assert_eq!(began, 1_542_082_631_842_000_000);
    let [index] = summary.metadata_indexes.as_slice() else {
        panic!("{:?}", summary.metadata_indexes);
    };
    assert_eq!(index.name, "bodyflight");
    let about = mcap::read::metadata(&bytes, index).unwrap().metadata;
    let file = std::fs::File::open(&table).unwrap();
    let reader = parquet::file::serialized_reader::SerializedFileReader::new(file).unwrap();
    let stored = reader.metadata().file_metadata().key_value_metadata();
    let of_table = |name: &str| {
        let found = stored.unwrap().iter().find(|entry| entry.key == name);
        found.unwrap().value.clone().unwrap()
    };
    let subject = std::fs::read_to_string(at("flight/subject.toml")).unwrap();
    let height = subject.lines().find(|line| line.starts_with("height_m"));
    for about in [
        &|name: &str| about[name].clone(),
        &of_table as &dyn Fn(&str) -> String,
    ] {
        assert!(about("program").starts_with("bodyflight "));
        assert!(about("arguments").starts_with("[\"export\","));
        assert!(about("flight").contains("flight.mvnx"));
        assert!(about("subject").contains(height.unwrap()));
    }
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
