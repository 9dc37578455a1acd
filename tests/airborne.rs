//! Jumps in real recordings by the real binary: found, and consistent with physics.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "airborne/discovered.rs"]
mod discovered;
#[path = "airborne/faults.rs"]
mod faults;
#[path = "airborne/table.rs"]
mod table;

use std::io::Read;
use std::path::{Path, PathBuf};

use bodyflight_tests::program::{Program, plain, written};
use serde_json::Value;

const PROGRAM: Program = Program(env!("CARGO_BIN_EXE_bodyflight"));

#[test]
fn somersaults_are_one_phase_that_only_the_exact_equations_predict() {
    for number in [1, 3] {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../verbs/data/acrobatics");
        let flight = folder.join(format!("flight-{number}.toml"));
        let (report, code) = PROGRAM.answer(&["airborne", plain(&flight)]);
        assert_eq!(code, Some(0), "{}", report["verdict"]);
        let phases = report["phases"].as_array().expect("phases");
        assert_eq!(phases.len(), 1, "{report}");
        assert!(phases[0]["length_s"].as_f64().expect("a length") > 1.0);
        let g = phases[0]["fall"]["g_mps2"].as_f64().expect("gravity");
        assert!((g / 9.81 - 1.0).abs() < 0.02, "{g}");
        let error = |model: &str| {
            let rows = phases[0]["predictions"].as_array().expect("rows");
            let is = |row: &&Value| row["model"] == model && row["length_s"] == 0.25;
            let row = rows.iter().find(is).expect("a row");
            row["smoothed"]["median_rad"]
                .as_f64()
                .expect("an angle")
                .to_degrees()
        };
        assert!(error("exact") < 4.0, "{}", error("exact"));
        let published = error("as-published");
        assert!(published > 5.0 * error("exact"), "{published}");
    }
}

fn acrobatics() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../verbs/data/acrobatics")
}

/// The text of a bundled recording.
fn recording(number: usize) -> String {
    let file = std::fs::File::open(acrobatics().join(format!("flight-{number}.mvnx.gz")));
    let mut text = String::new();
    let mut unpacked = flate2::read::GzDecoder::new(file.expect("the recording"));
    unpacked.read_to_string(&mut text).expect("text");
    text
}

/// The text without elements of this name.
fn without(text: &str, name: &str) -> String {
    let (begin, end) = (format!("<{name}>"), format!("</{name}>"));
    let mut parts = text.split(&begin);
    let mut kept = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        kept.push_str(part.split_once(&end).expect("its end").1);
    }
    kept
}

#[test]
fn velocities_that_a_recording_lacks_are_differences() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = recording(1);
    let bare = without(&without(&whole, "velocity"), "angularVelocity");
    assert!(bare.len() < whole.len());
    let exact = |text: &str| {
        let file = written(folder.path(), "flight.mvnx", text);
        let (report, _) = PROGRAM.answer(&["airborne", &file]);
        let rows = report["phases"][0]["predictions"].as_array().cloned();
        let rows = rows.expect("rows");
        let is = |row: &&Value| row["model"] == "exact" && row["length_s"] == 0.25;
        let row = rows.iter().find(is).expect("a row");
        row["smoothed"]["median_rad"].as_f64().expect("an angle")
    };
    let (with, without) = (exact(&whole), exact(&bare));
    assert!(
        (with - without).abs().to_degrees() < 0.5,
        "{with} rad, {without} rad"
    );
}

#[test]
fn a_second_subject_is_reported() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = recording(1);
    let begin = whole.find("<subject").expect("a subject");
    let end = whole.find("</subject>").expect("its end") + "</subject>".len();
    let label = whole[begin..]
        .split("label=\"")
        .nth(1)
        .and_then(|rest| rest.split('"').next());
    let label = label.expect("a label");
    let other = whole[begin..end].replace(&format!("label=\"{label}\""), "label=\"Eve\"");
    let two = format!("{}{other}{}", &whole[..end], &whole[end..]);
    let file = written(folder.path(), "two.mvnx", &two);
    let (report, _) = PROGRAM.answer(&["inspect", &file]);
    let said = report.to_string();
    assert!(said.contains("second subject, Eve"), "{said}");
}

#[test]
fn a_prop_is_reported_and_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let whole = recording(1);
    let from = whole.find("label=\"LeftToe\"").expect("the last segment");
    let end = whole[from..]
        .find("</segments>")
        .expect("the end of segments")
        + from;
    let listed = format!(
        "{}<segment label=\"Prop1\" id=\"24\"></segment>{}",
        &whole[..end],
        &whole[end..]
    );
    let mut text = listed.replace("segmentCount=\"23\"", "segmentCount=\"24\"");
    for (name, width, own) in [
        ("orientation", 4, " 1 0 0 0"),
        ("position", 3, " 9 9 9"),
        ("velocity", 3, " 0 0 0"),
        ("acceleration", 3, " 0 0 0"),
        ("angularVelocity", 3, " 0 0 0"),
    ] {
        let tag = format!("<{name}>");
        let mut parts = text.split(&tag);
        let mut longer = parts.next().expect("a part").to_owned();
        for part in parts {
            let (numbers, rest) = part.split_once('<').expect("its end");
            assert_eq!(numbers.split_whitespace().count(), 23 * width, "{name}");
            longer.push_str(&format!("{tag}{numbers}{own}<{rest}"));
        }
        text = longer;
    }
    let file = written(folder.path(), "prop.mvnx", &text);
    let (report, _) = PROGRAM.answer(&["inspect", &file]);
    assert!(
        report
            .to_string()
            .contains("the segment Prop1 is not part of the body"),
        "{report}"
    );
    let (report, _) = PROGRAM.answer(&["airborne", &file]);
    assert_eq!(
        report["phases"].as_array().map(Vec::len),
        Some(1),
        "{report}"
    );
}

#[test]
fn tables_of_captures_are_judged_by_source() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut table = String::new();
    for number in [1, 3] {
        let file = acrobatics().join(format!("flight-{number}.toml"));
        table.push_str(&format!(
            "[[captures]]\nsource = \"Montreal\"\nperson = \"A\"\nfile = \"{}\"\n",
            plain(&file)
        ));
    }
    let cmu = acrobatics().join("../cmu/01_01.amc.gz");
    let absent = "[[captures]]\nsource = \"CMU\"\nperson = \"13\"\nfile = \"13_11.amc\"\n";
    table.push_str(&format!(
        "[[captures]]\nsource = \"CMU\"\nperson = \"01\"\nfile = \"{}\"\n{absent}",
        plain(&cmu)
    ));
    let file = written(folder.path(), "captures.toml", &table);
    let (report, code) = PROGRAM.answer(&["validate", &file]);
    assert_eq!(code, Some(0), "{report}");
    let skipped = &report["captures"]["skipped"];
    assert_eq!(skipped.as_array().map(Vec::len), Some(1), "{skipped}");
    assert!(
        skipped[0]["reason"]
            .as_str()
            .is_some_and(|why| why.contains("absent"))
    );
    let sources = report["captures"]["sources"].as_array().expect("sources");
    let names: Vec<&str> = sources
        .iter()
        .filter_map(|row| row["source"].as_str())
        .collect();
    assert_eq!(names, ["Montreal", "CMU", "all"]);
    for (row, people, phases) in [(0, 1, 2), (1, 1, 2), (2, 2, 4)] {
        assert_eq!(sources[row]["people"], people);
        assert_eq!(sources[row]["phases"], phases);
    }
    let error = |row: usize, model: &str| {
        let rows = sources[row]["predictions"].as_array().expect("rows");
        let row = rows
            .iter()
            .find(|row| row["model"] == model)
            .expect("a row");
        row["smoothed"]["median_rad"]
            .as_f64()
            .expect("an angle")
            .to_degrees()
    };
    // Jumps of another laboratory, without a subject.
    let (exact, published) = (error(1, "exact"), error(1, "as-published"));
    assert!(
        exact < 1.5 && published > 3.0 * exact,
        "{exact}, {published}"
    );
    let odd = written(
        folder.path(),
        "odd.toml",
        &table.replacen("person", "name", 1),
    );
    let said = PROGRAM.fails(&["validate", &odd], 2);
    assert!(
        said.contains("odd.toml:3") && said.contains("name"),
        "{said}"
    );
}

#[test]
fn the_momentum_of_a_somersault_is_exported() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = folder.path().join("flight.csv");
    let flight = acrobatics().join("flight-1.toml");
    PROGRAM.json(&["export", plain(&flight), "--out", plain(&out)]);
    let mut table = csv::Reader::from_path(&out).expect("a table");
    let names = table.headers().expect("names").clone();
    let rows: Vec<csv::StringRecord> = table.records().map(|row| row.expect("a row")).collect();
    let column = |name: &str| -> Vec<f64> {
        let place = names.iter().position(|own| own == name);
        let place = place.expect("the column");
        rows.iter()
            .map(|row| row[place].parse().expect("a number"))
            .collect()
    };
    let size =
        |k: usize, of: &[Vec<f64>]| of.iter().map(|part| part[k].powi(2)).sum::<f64>().sqrt();
    let parts = ["north", "west", "up"]
        .map(|part| column(&format!("measured_angular_momentum_{part}_nms")));
    let sizes: Vec<f64> = (0..rows.len()).map(|k| size(k, &parts)).collect();
    let mean = sizes.iter().sum::<f64>() / sizes.len() as f64;
    let off = sizes.iter().map(|size| (size - mean).powi(2)).sum::<f64>() / sizes.len() as f64;
    assert!(
        mean > 10.0 && off.sqrt() < 0.15 * mean,
        "{mean} N m s, {}",
        off.sqrt()
    );
    // The momentum loses the weight in each second, and the centre of mass moves with it.
    let (time, up) = (column("time_s"), column("measured_linear_momentum_up_ns"));
    let last = rows.len() - 1;
    let force = (up[last] - up[0]) / (time[last] - time[0]);
    let height = column("measured_cg_position_up_m");
    let rise = (height[last] - height[0]) / (time[last] - time[0]);
    let mass = -force / 9.81;
    assert!((40.0..100.0).contains(&mass), "{mass} kg");
    let speed = up.iter().sum::<f64>() / up.len() as f64 / mass;
    assert!((speed - rise).abs() < 0.3, "{speed} m/s, {rise} m/s");
}
