//! Recordings and tracks that are nonsense without being damaged: the tables of docs/nonsense.md, row by row and verb by
//! verb.

#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "nonsense/kinds.rs"]
mod kinds;
#[path = "nonsense/tracks.rs"]
mod tracks;

use std::fs;
use std::path::Path;
use std::process::Command;

use bodyflight_tests::program::text;
use kinds::{KINDS, Kind, Recorded};

const VERBS: [&str; 5] = ["inspect", "simulate", "estimate", "discover", "view"];

fn bodyflight(arguments: &[&str]) -> (String, Option<i32>) {
    let mut command = Command::new(env!("CARGO_BIN_EXE_bodyflight"));
    let output = command.args(arguments).output().expect("the binary starts");
    let all = text(&output.stdout) + &text(&output.stderr);
    assert!(!all.contains("panicked"), "{arguments:?}: {all}");
    let words = all.split_whitespace().filter(|word| *word != "│");
    (words.collect::<Vec<_>>().join(" "), output.status.code())
}

/// The page, of which each part has one table: that of recordings, then that of tracks.
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
fn differs(folder: &Path, row: &[&str]) -> Vec<String> {
    let [kind, sentence, codes @ ..] = row else {
        return vec![format!("{row:?}: expected a kind, a sentence and codes")];
    };
    let at = |name: &str| folder.join(name).to_str().expect("plain").to_owned();
    let mut wrong = Vec::new();
    for (verb, code) in VERBS.iter().zip(codes) {
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
        // What is not doubted need not be said by every verb, and what a recording's activity is only by inspect.
        let must_say = code != 0 || *verb == "inspect" && !sentence.contains("carries");
        if ended != Some(code) || must_say && !said.contains(sentence) {
            wrong.push(format!("{kind}: {verb} ends with {ended:?}: {said}"));
        }
    }
    wrong
}

#[test]
fn no_verb_is_silent_about_any_kind_of_nonsense() {
    let page = part(0);
    let folder = tempfile::tempdir().expect("a folder");
    let good = folder.path().join("good");
    let good = good.to_str().expect("plain");
    let (said, code) = bodyflight(&["synth", "barrel-roll", "--out", good]);
    assert_eq!(code, Some(0), "{said}");
    let recorded = Recorded::read(Path::new(good));
    let mut wrong = Vec::new();
    let mut seen = Vec::new();
    for row in rows(&page) {
        let Some(kind) = KINDS.iter().find(|kind| kind.name == row[0]) else {
            wrong.push(format!("{}: no such kind", row[0]));
            continue;
        };
        let made = folder.path().join("made");
        recorded.write(&made, kind);
        wrong.extend(differs(&made, &row));
        seen.push(kind.name);
    }
    let missing = KINDS.iter().map(|Kind { name, .. }| name);
    let missing: Vec<_> = missing.filter(|name| !seen.contains(name)).collect();
    assert!(missing.is_empty(), "not in the table: {missing:?}");
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn fall_is_not_silent_about_any_kind_of_nonsense() {
    let page = part(1);
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
