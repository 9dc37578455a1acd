//! Recordings and tracks that are nonsense without being damaged: the tables of docs/nonsense.md, row by row and verb by
//! verb.

#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "nonsense/bodies.rs"]
mod bodies;
#[path = "imports/c3d.rs"]
mod c3d;
#[path = "nonsense/files.rs"]
mod files;
#[path = "nonsense/imports.rs"]
mod imports;
#[path = "nonsense/kinds.rs"]
mod kinds;
#[path = "nonsense/listen.rs"]
mod listen;
#[path = "nonsense/mixed.rs"]
mod mixed;
#[path = "nonsense/orientations.rs"]
mod orientations;
#[path = "nonsense/recorded.rs"]
mod recorded;
#[path = "nonsense/slimevr.rs"]
mod slimevr;
#[path = "nonsense/tracks.rs"]
mod tracks;

use std::fs;
use std::path::Path;
use std::process::Command;

use bodies::BODIES;
use bodyflight_tests::program::text;
use kinds::KINDS;
use mixed::MIXED;
use recorded::{Kind, Recorded};

/// Columns of the tables of whole recordings and of parts.
const VERBS: [&str; 5] = ["inspect", "simulate", "estimate", "discover", "view"];
const VERBS_OF_PARTS: [&str; 2] = ["inspect", "simulate"];

fn bodyflight(arguments: &[&str]) -> (String, Option<i32>) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bodyflight"));
    let output = command.args(arguments).output().expect("the binary starts");
    let all = text(&output.stdout) + &text(&output.stderr);
    assert!(!all.contains("panicked"), "{arguments:?}: {all}");
    let words = all.split_whitespace().filter(|word| *word != "│");
    (words.collect::<Vec<_>>().join(" "), output.status.code())
}

/// The page, of which each part has one table: whole recordings, parts of recordings, bodies, imports, tracks.
fn part(number: usize) -> String {
    let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/nonsense.md");
    let page = fs::read_to_string(page).expect("the page");
    let parts = page.split("\n## ").nth(number);
    parts.expect("a part of the page").to_owned()
}

/// The cells of a table's rows.
fn rows(part: &str) -> Vec<Vec<&str>> {
    let rows = part.lines().filter(|line| line.starts_with("| "));
    rows.skip(1)
        .map(|row| row.trim_matches('|').split('|').map(str::trim).collect())
        .collect()
}

/// Runs the verbs of a row on a flight and returns what differs from it.
fn differs(folder: &Path, row: &[&str], verbs: &[&str]) -> Vec<String> {
    let [kind, sentence, codes @ ..] = row else {
        return vec![format!("{row:?}: expected a kind, a sentence and codes")];
    };
    let at = |name: &str| folder.join(name).to_str().expect("plain").to_owned();
    let mut wrong = Vec::new();
    for (verb, code) in verbs.iter().zip(codes) {
        let Ok(code) = code.parse::<i32>() else {
            continue;
        };
        let (said, ended) = match *verb {
            "inspect" => bodyflight(&[
                "inspect",
                &at("flight.mvnx"),
                "--subject",
                &at("subject.toml"),
            ]),
            "view" => bodyflight(&["view", &at(""), "--out", &at("page.html"), "--force"]),
            verb => bodyflight(&[verb, &at("")]),
        };
        // What is not doubted need not be said by every verb.
        let must_say = code != 0 || *verb == "inspect";
        if ended != Some(code) || must_say && !said.contains(sentence) {
            wrong.push(format!("{kind}: {verb} ends with {ended:?}: {said}"));
        }
    }
    wrong
}

/// The flight of the laboratory from which all kinds are made.
fn recorded(folder: &Path) -> Recorded {
    let good = folder.join("good");
    let good = good.to_str().expect("plain");
    let (said, code) = bodyflight(&["synth", "barrel-roll", "--out", good]);
    assert_eq!(code, Some(0), "{said}");
    Recorded::read(Path::new(good))
}

fn kind(name: &str) -> Option<&'static Kind> {
    let all = KINDS.iter().chain(&MIXED).chain(&BODIES);
    all.into_iter().find(|kind| kind.name == name)
}

/// Checks the rows of a part of the page, which must have a row for each of these kinds.
fn checked(number: usize, verbs: &[&str], kinds: &[Kind]) {
    let page = part(number);
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let mut wrong = Vec::new();
    let mut seen = Vec::new();
    for row in rows(&page) {
        let Some(kind) = kind(row[0]) else {
            wrong.push(format!("{}: no such kind", row[0]));
            continue;
        };
        let made = folder.path().join("made");
        recorded.write(&made, kind);
        wrong.extend(differs(&made, &row, verbs));
        seen.push(kind.name);
    }
    let missing = kinds.iter().map(|Kind { name, .. }| name);
    let missing: Vec<_> = missing.filter(|name| !seen.contains(name)).collect();
    assert!(missing.is_empty(), "not in the table: {missing:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn no_verb_is_silent_about_any_kind_of_nonsense() {
    checked(0, &VERBS, &KINDS);
}

#[test]
fn no_verb_is_silent_about_a_part_that_contradicts_the_rest() {
    checked(1, &VERBS_OF_PARTS, &MIXED);
}

#[test]
fn no_verb_is_silent_about_bodies_that_are_none() {
    checked(2, &VERBS_OF_PARTS, &BODIES);
}

/// The verbs that the tables leave out, on one kind: all of them ask the same checks.
#[test]
fn every_verb_that_reads_a_flight_says_its_doubt() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    for (name, kind_name) in [("good", "nothing"), ("bad", "forearm frozen from 4 s")] {
        recorded.write(&folder.path().join(name), kind(kind_name).expect("a kind"));
    }
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let [good, bad, csv, drawn] = ["good", "bad", "a.csv", "drawn"].map(at);
    let validated = ["validate", &bad];
    for arguments in [
        &["estimate", &bad][..],
        &["export", &bad, "--out", &csv],
        &["compare", &good, &bad, "--align", "start"],
        &["compare", &bad, &good, "--align", "start"],
        &["technique", &bad],
        &["sensitivity", &bad],
        &["tune", &bad, "--draws", "2"],
        &["figures", &bad, "--format", "svg", "--out", &drawn],
        &["stream", &bad, "--virtual", "--speed", "max"],
        &validated,
    ] {
        let (said, ended) = bodyflight(arguments);
        assert_eq!(ended, Some(5), "{arguments:?}: {said}");
        let sentence = "r_forearm keeps exactly the same attitude";
        assert!(said.contains(sentence), "{arguments:?}: {said}");
    }
}

/// What makes no recording useless is said all the same.
#[test]
fn remarks_are_printed_by_every_verb() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let made = folder.path().join("made");
    recorded.write(&made, kind("one frame in twenty repeated").expect("a kind"));
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let (made, good) = (at("made"), at("good"));
    for arguments in [
        &["estimate", &made][..],
        &["technique", &made],
        &["compare", &good, &made, "--align", "start"],
        &["sensitivity", &made],
        &["tune", &made, "--draws", "1"],
    ] {
        let (said, _) = bodyflight(arguments);
        assert!(
            said.contains("warning: ") && said.contains("frames were lost and filled"),
            "{arguments:?}: {said}"
        );
    }
}

/// Persons and coefficients that are nonsense without any recording, and those for which the model diverges.
#[test]
fn persons_that_are_none_are_doubted() {
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let write = |name: &'static str, file, from, to| {
        recorded.write(
            &folder.path().join(name),
            &recorded::edited(name, file, from, to),
        );
        let made = folder.path().join(name);
        made.to_str().expect("plain").to_owned()
    };
    let heavy = write("heavy", "subject.toml", "mass_kg = 75.0", "mass_kg = 200");
    let wild = write("wild", "subject.toml", "cl = 1.8", "cl = 100.0");
    let sudden = write("sudden", "subject.toml", "cd = 1.2", "cd = 12.0");
    let arched = write(
        "arched",
        "subject.toml",
        "f_arch = \"posture\"",
        "f_arch = 10.0",
    );
    let windy = write(
        "windy",
        "flight.toml",
        "[air]",
        "[air]\nvelocity = [80, 0, 0]",
    );
    let thick = write("thick", "flight.toml", "density = 1", "density = 1.9");
    let subject = format!("{heavy}/subject.toml");
    for (arguments, sentence) in [
        (&["trim", &subject][..], "is the mass in kg?"),
        (&["trim", &arched], "f_arch of the subject is 10, expected"),
        (&["simulate", &sudden], "cd of the subject is 12, expected"),
        (
            &["simulate", &arched],
            "f_arch of the subject is 10, expected",
        ),
        (&["simulate", &windy], "moves the air sideways at 80 m/s"),
        (
            &["estimate", &thick],
            "density is 1.9 kg/m3, expected 0.3 to",
        ),
        (&["trim", "--density", "0.05"], "is not that of a person"),
        (&["tune", &wild, "--draws", "1"], "cl of the subject is 100"),
    ] {
        let (said, ended) = bodyflight(arguments);
        assert_eq!(ended, Some(5), "{arguments:?}: {said}");
        assert!(said.contains(sentence), "{arguments:?}: {said}");
    }
}

/// Segment tables of persons that are none, or of others than the subject.
#[test]
fn segment_tables_of_nobody_are_doubted_or_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    recorded(folder.path());
    let good = folder.path().join("good");
    let at = |name: &str| good.join(name).to_str().expect("plain").to_owned();
    let subject = "height_m = 1.75\nmass_kg = 75\nsex = \"male\"\nsegments = \"segments.json\"\n";
    fs::write(at("subject.toml"), subject).expect("written");
    for (row, code, sentence) in [
        (
            r#""name": "l_forearm", "mass": 4"#,
            5,
            "l_forearm of the subject weighs 4.00 kg",
        ),
        (
            r#""name": "head", "mass": 1"#,
            5,
            "head of the subject weighs 1.00 kg",
        ),
        (
            r#""name": "r_thigh", "inertia": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]"#,
            5,
            "is it in kg m2",
        ),
        (
            r#""name": "l_shank", "cg": [0, 0, 0.2]"#,
            5,
            "from its proximal joint",
        ),
        (
            r#""name": "l_thigh", "joint_offset": [-0.1, 0, 0]"#,
            5,
            "the left hip of the subject is right of the right one",
        ),
        (r#""name": "thorax", "mass": 50"#, 2, "correct one of them"),
    ] {
        fs::write(
            at("segments.json"),
            format!(r#"{{"segments": [{{{row}}}]}}"#),
        )
        .expect("written");
        let arguments = [
            "inspect",
            &at("flight.mvnx"),
            "--subject",
            &at("subject.toml"),
        ];
        let (said, ended) = bodyflight(&arguments);
        assert_eq!(ended, Some(code), "{row}: {said}");
        assert!(said.contains(sentence), "{row}: {said}");
    }
}

#[test]
fn import_is_not_silent_about_any_kind_of_nonsense() {
    let page = part(3);
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let [table, map, out] = ["table.csv", "map.toml", "out"].map(at);
    fs::write(&map, imports::mapping()).expect("written");
    let subject = at("good/subject.toml");
    let mut wrong = Vec::new();
    for row in rows(&page) {
        let [name, sentence, code] = row[..] else {
            panic!("{row:?}: expected a kind, a sentence and a code");
        };
        let kind = kind(name).expect("a kind");
        fs::write(&table, imports::table(&recorded, kind)).expect("written");
        let arguments = [
            "import",
            &table,
            "--mapping",
            &map,
            "--subject",
            &subject,
            "--out",
            &out,
            "--force",
        ];
        let (said, ended) = bodyflight(&arguments);
        if ended != code.parse().ok() || !said.contains(sentence) {
            wrong.push(format!("{name}: ends with {ended:?}: {said}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn import_is_not_silent_about_files_that_contradict_themselves() {
    let page = part(4);
    let folder = tempfile::tempdir().expect("a folder");
    let recorded = recorded(folder.path());
    let at = |name: &str| folder.path().join(name).to_str().expect("plain").to_owned();
    let (subject, out) = (at("good/subject.toml"), at("out"));
    let mut wrong = Vec::new();
    let mut seen = Vec::new();
    for row in rows(&page) {
        let [name, sentence, code] = row[..] else {
            panic!("{row:?}: expected a kind, a sentence and a code");
        };
        let Some(kind) = files::OTHERS.iter().find(|kind| kind.name == name) else {
            wrong.push(format!("{name}: no such kind"));
            continue;
        };
        let own = kind.written(&recorded, folder.path());
        let mut arguments = vec!["import"];
        arguments.extend(own.iter().map(String::as_str));
        arguments.extend(["--subject", &subject, "--out", &out, "--force"]);
        let (said, ended) = bodyflight(&arguments);
        if ended != code.parse().ok() || !said.contains(sentence) {
            wrong.push(format!("{name}: ends with {ended:?}: {said}"));
        }
        seen.push(kind.name);
    }
    let missing = files::OTHERS.iter().map(|kind| kind.name);
    let missing: Vec<_> = missing.filter(|name| !seen.contains(name)).collect();
    assert!(missing.is_empty(), "not in the table: {missing:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn fall_is_not_silent_about_any_kind_of_nonsense() {
    let page = part(5);
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("TRACK.CSV");
    let mut wrong = Vec::new();
    let mut seen = Vec::new();
    for row in rows(&page) {
        let [name, sentence, code] = row[..] else {
            panic!("{row:?}: expected a kind, a sentence and a code");
        };
        let kind = tracks::KINDS.iter().find(|kind| kind.name == name);
        let Some(kind) = kind else {
            wrong.push(format!("{name}: no such kind"));
            continue;
        };
        fs::write(&path, tracks::text(kind)).expect("written");
        let (said, ended) = bodyflight(&["fall", path.to_str().expect("plain")]);
        assert!(!said.contains("NaN"), "{name}: {said}");
        if ended != code.parse().ok() || !said.contains(sentence) {
            wrong.push(format!("{name}: ends with {ended:?}: {said}"));
        }
        seen.push(kind.name);
    }
    let missing = tracks::KINDS.iter().map(|kind| kind.name);
    let missing: Vec<_> = missing.filter(|name| !seen.contains(name)).collect();
    assert!(missing.is_empty(), "not in the table: {missing:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
