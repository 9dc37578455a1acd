//! A marker that slips along the skin: import, inspect and airborne name it with segment and time.

use std::fmt::Write;
use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_core::body::posture::pose;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::program::{plain, text, written};
use nalgebra::Vector3;
use serde_json::Value;

use crate::known::{PROGRAM, known};

/// Joints with the segment whose joint it is, or at whose end it is.
const POINTS: [(&str, Segment, bool); 14] = [
    ("lhip", Segment::LeftThigh, false),
    ("lknee", Segment::LeftShank, false),
    ("lankle", Segment::LeftShank, true),
    ("rhip", Segment::RightThigh, false),
    ("rknee", Segment::RightShank, false),
    ("rankle", Segment::RightShank, true),
    ("lshoulder", Segment::LeftUpperArm, false),
    ("lelbow", Segment::LeftForearm, false),
    ("lwrist", Segment::LeftForearm, true),
    ("rshoulder", Segment::RightUpperArm, false),
    ("relbow", Segment::RightForearm, false),
    ("rwrist", Segment::RightForearm, true),
    ("neck", Segment::Head, false),
    ("crown", Segment::Head, true),
];

const LIMBS: [(&str, &str, &str); 8] = [
    ("l_thigh", "lhip", "lknee"),
    ("l_shank", "lknee", "lankle"),
    ("r_thigh", "rhip", "rknee"),
    ("r_shank", "rknee", "rankle"),
    ("l_upperarm", "lshoulder", "lelbow"),
    ("l_forearm", "lelbow", "lwrist"),
    ("r_upperarm", "rshoulder", "relbow"),
    ("r_forearm", "relbow", "rwrist"),
];

/// A table of joints of the known flight, on skin that moves: each point swings by up to 6 mm with the motion of the body,
/// and by 1 mm at random. `slip` moves one point along a segment from a time on.
fn table(slip: Option<(&str, [&str; 2], f64, f64, f64)>) -> String {
    let body = Subject::default().body();
    let mut text = "time".to_owned();
    for (name, ..) in POINTS {
        let _ = write!(text, ",{name}.x,{name}.y,{name}.z");
    }
    let mut state = 7_u32;
    let mut noise = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        0.002 * (f64::from(state >> 8) / f64::from(1_u32 << 24) - 0.5)
    };
    for (row, frame) in known().iter().enumerate() {
        let time = 0.005 * row as f64;
        let posed = pose(&body, &frame.posture);
        let attitude = *frame.pelvis.inertial_from_body.quaternion();
        let mut places: Vec<Vector3<f64>> = (POINTS.iter().zip(0_u32..))
            .map(|((name, segment, is_end), k)| {
                let length = body.segments[*segment].length;
                let up = if *name == "crown" { 1.0 } else { -1.0 };
                let way = Vector3::z() * (if *is_end { up * length } else { 0.0 });
                let own = posed[*segment].body_from_segment;
                let skin = own * Vector3::z() * (0.006 * (9.0 * time + f64::from(k)).sin());
                let place = posed[*segment].joint + own * way + skin;
                let noise = Vector3::new(noise(), noise(), noise());
                frame.pelvis.position.components + attitude * place + noise
            })
            .collect();
        if let Some((point, ends, begin, duration, size)) = slip {
            let at = |name: &str| {
                let found = POINTS.iter().position(|(own, ..)| *own == name);
                found.expect("a point")
            };
            let along = (places[at(ends[1])] - places[at(ends[0])]).normalize();
            let share = ((time - begin) / duration).clamp(0.0, 1.0);
            places[at(point)] += along * (size * share);
        }
        let _ = write!(text, "\n{time}");
        for place in places {
            let _ = write!(text, ",{:.5},{:.5},{:.5}", place.x, place.y, place.z);
        }
    }
    text
}

fn mapping(folder: &Path) -> String {
    let mut map = "kind = \"points\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[time]\ncolumn = \"time\"\n\
        [segments.pelvis]\nfrom = [\"lhip\", \"rhip\"]\nto = \"neck\"\nleft = [\"rhip\", \"lhip\"]\n\
        [segments.thorax]\nfrom = [\"lhip\", \"rhip\"]\nto = \"neck\"\nleft = [\"rshoulder\", \"lshoulder\"]\n\
        [segments.head]\nfrom = \"neck\"\nto = \"crown\"\n"
        .to_owned();
    for (segment, from, to) in LIMBS {
        let _ = write!(
            map,
            "[segments.{segment}]\nfrom = \"{from}\"\nto = \"{to}\"\n"
        );
    }
    written(folder, "points.toml", &map)
}

fn slips(folder: &Path, file: &str, map: &str) -> Vec<Value> {
    let out = plain(&folder.join("out")).to_owned();
    let (report, code) =
        PROGRAM.answer(&["import", file, "--mapping", map, "--out", &out, "--force"]);
    let slips = report["slips"].as_array().expect("slips").clone();
    assert_eq!(code, Some(if slips.is_empty() { 0 } else { 5 }), "{report}");
    for slip in &slips {
        let message = &slip["message"];
        let warnings = report["warnings"].as_array().expect("warnings");
        assert!(warnings.contains(message), "{report}");
    }
    slips
}

#[test]
fn a_marker_that_slips_is_named_with_segment_and_time() {
    let folder = tempfile::tempdir().expect("a folder");
    let map = mapping(folder.path());
    let clean = written(folder.path(), "clean.csv", &table(None));
    assert!(slips(folder.path(), &clean, &map).is_empty());
    for (point, ends, duration, size) in [
        ("lknee", ["lhip", "lknee"], 0.001, 0.05),
        ("rwrist", ["relbow", "rwrist"], 0.001, -0.05),
        ("relbow", ["rshoulder", "relbow"], 0.05, 0.05),
        ("lankle", ["lknee", "lankle"], 0.1, -0.05),
    ] {
        let slip = Some((point, ends, 0.53, duration, size));
        let file = written(folder.path(), "slip.csv", &table(slip));
        let found = slips(folder.path(), &file, &map);
        assert_eq!(found.len(), 1, "{point}: {found:?}");
        let markers = found[0]["markers"].as_array().expect("markers");
        assert!(markers.contains(&Value::from(point)), "{point}: {found:?}");
        let off = found[0]["begin_s"].as_f64().expect("a time") - 0.53;
        assert!(off.abs() < 0.1, "{point}: {found:?}");
        let change = found[0]["change_m"].as_f64().expect("a length");
        assert!((change.abs() - 0.05).abs() < 0.01, "{point}: {found:?}");
    }
}

#[test]
fn inspect_and_airborne_know_of_the_slip() {
    let folder = tempfile::tempdir().expect("a folder");
    let map = mapping(folder.path());
    let slip = Some(("lknee", ["lhip", "lknee"], 0.53, 0.05, 0.05));
    let file = written(folder.path(), "slip.csv", &table(slip));
    let output = PROGRAM.run(&["inspect", &file, "--mapping", &map, "--json"]);
    assert_eq!(output.status.code(), Some(5), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let warning = &report["flight"]["warnings"][0];
    assert_eq!(warning["is_fault"], true, "{report}");
    assert_eq!(warning["segment"], "l_thigh", "{report}");
    let said = report["verdict"].as_str().expect("a verdict");
    assert!(
        said.contains("lknee") && said.contains("slipped at 0.5"),
        "{said}"
    );
    let output = PROGRAM.run(&["airborne", &file, "--mapping", &map, "--json"]);
    assert_eq!(output.status.code(), Some(4), "{}", text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let faults = report["verdict"]["faults"].as_array().expect("faults");
    let named = faults
        .iter()
        .any(|fault| fault["kind"] == "recording" && fault["segments"][0] == "l_thigh");
    assert!(named, "{report}");
}
