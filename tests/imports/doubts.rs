//! Imported recordings that contradict themselves or are no flight, in several formats; docs/nonsense.md has the kinds.

use std::fmt::Write;
use std::path::Path;

use bodyflight_mvnx::xsens;
use bodyflight_tests::program::{plain, text, written};
use serde_json::Value;

use crate::known::PROGRAM;
use crate::markers::{points, points_mapping, trc};
use crate::{bvh, c3d};

/// Imports a file that is doubted, and returns its report and what it says without `--json`.
fn doubted(folder: &Path, arguments: &[&str]) -> (Value, String) {
    let out = plain(&folder.join("out")).to_owned();
    let all = [&["import"], arguments, &["--out", &out, "--force"]].concat();
    let (report, code) = PROGRAM.answer(&all);
    assert_eq!(code, Some(5), "{report}");
    // The flight is written all the same.
    assert!(folder.join("out/flight.toml").exists());
    let output = PROGRAM.run(&all);
    assert_eq!(output.status.code(), Some(5));
    (report, text(&output.stdout) + &text(&output.stderr))
}

fn says(found: &(Value, String), sentence: &str) {
    let (report, said) = found;
    let doubts = report["doubts"].as_array().expect("doubts");
    let is_listed = doubts
        .iter()
        .any(|doubt| doubt.as_str().is_some_and(|doubt| doubt.contains(sentence)));
    assert!(is_listed && said.contains(sentence), "{report}\n{said}");
}

#[test]
fn a_person_who_stands_is_no_flight_in_any_format() {
    let folder = tempfile::tempdir().expect("a folder");
    let (names, mut frames) = points();
    let first = frames.swap_remove(0);
    let stands: Vec<Vec<[f64; 3]>> = (0..600)
        .map(|index| {
            let sway = 5.0 * (0.02 * f64::from(index)).sin();
            first.iter().map(|[x, y, z]| [x + sway, *y, *z]).collect()
        })
        .collect();
    let map = points_mapping(folder.path());
    let c3d = folder.path().join("stands.c3d");
    std::fs::write(&c3d, c3d::written(&names, &stands, 200.0)).expect("written");
    let trc = written(folder.path(), "stands.trc", &trc(&names, &stands));
    let bvh = bvh::written(&xsens::t_pose(), str::to_owned);
    let (head, rows) = bvh.split_once("MOTION\n").expect("a motion");
    let (place, angles) =
        (rows.lines().nth(2).and_then(|row| row.split_once(' '))).expect("a first row");
    let place: f64 = place.parse().expect("a number");
    let mut text = format!("{head}MOTION\nFrames: 600\nFrame Time: 0.005\n");
    for index in 0..600 {
        let sway = 0.5 * (0.02 * f64::from(index)).sin();
        let _ = writeln!(text, "{:.4} {angles}", place + sway);
    }
    let bvh = written(folder.path(), "stands.bvh", &text);
    for arguments in [
        &[plain(&c3d), "--mapping", &map][..],
        &[&trc, "--mapping", &map],
        &[&bvh],
    ] {
        let found = doubted(folder.path(), arguments);
        says(&found, "for 100 % of the time something carries the body");
    }
}
