//! Files of one kind where another belongs: every verb that reads a file, with every kind that users have at hand.

use std::fs;
use std::path::Path;

use bodyflight_tests::program::plain;

use crate::{PROGRAM, make, table::Made};

/// Kinds of files: name of the file, its content, and what the program calls it. An empty content stands for a file that
/// every folder with a good flight has.
const FOUND: [(&str, &[u8], &str); 12] = [
    ("flight.mvnx", b"", "this is an MVNX recording, not "),
    ("flight.toml", b"", "this is a flight.toml, not "),
    ("subject.toml", b"", "this is a subject, not "),
    ("inputs.csv", b"", "this is a table of inputs, not "),
    (
        "model.toml",
        b"[[effect]]\nname = \"wind\"\n",
        "this is a model.toml, not ",
    ),
    (
        "track.csv",
        b"time_s,north_m,east_m,height_m\n0,0,0,4000\n1,0,0,3995\n",
        "this is the track of a logger, not ",
    ),
    (
        "picture.png",
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
        "this is a picture, not ",
    ),
    (
        "page.html",
        b"<!DOCTYPE html>\n<html></html>\n",
        "this is a web page, not ",
    ),
    ("paper.pdf", b"%PDF-1.7\n", "this is a PDF document, not "),
    (
        "notes.txt",
        b"exit at 4000 m\n",
        "this is text of no known kind, not ",
    ),
    ("blank.txt", b"\n", "this file is empty"),
    ("empty", b"", "this is a folder, not a file"),
];

/// Calls with `#` for the file, the kinds that they take, and the words for the kind that belongs there.
const CALLS: [(&str, &[&str], &str); 27] = [
    ("trim #", &["subject.toml"], "a subject.toml"),
    ("fly # --out @fly.html", &["subject.toml"], "a subject.toml"),
    (
        "synth rotations --out @out --subject #",
        &["subject.toml"],
        "a subject.toml",
    ),
    (
        "hide clean --out @out --subject #",
        &["subject.toml"],
        "a subject.toml",
    ),
    (
        "simulate @flight.toml --subject #",
        &["subject.toml"],
        "a subject.toml",
    ),
    (
        "inspect @flight.mvnx --subject #",
        &["subject.toml"],
        "a subject.toml",
    ),
    (
        "simulate @flight.toml --model #",
        &["model.toml"],
        "a model.toml",
    ),
    ("hide --out @out --model #", &["model.toml"], "a model.toml"),
    (
        "export @flight.toml --out @e.csv --model #",
        &["model.toml"],
        "a model.toml",
    ),
    (
        "estimate @flight.toml --preset #",
        &["empty"],
        "a preset.toml",
    ),
    (
        "import @a.bvh --out @out --mapping #",
        &[],
        "a mapping.toml",
    ),
    ("view @flight.toml --out @v.html --discovery #", &[], "JSON"),
    (
        "fmu # --out @f.fmu",
        &["flight.toml", "subject.toml", "empty"],
        "a subject.toml",
    ),
    ("simulate #", FLIGHTS, ""),
    ("estimate #", FLIGHTS, ""),
    ("sensitivity #", FLIGHTS, ""),
    ("compare # @flight.mvnx", FLIGHTS, ""),
    ("technique #", FLIGHTS, ""),
    ("export # --out @e.csv", FLIGHTS, ""),
    ("figures # --out @figures", FLIGHTS, ""),
    ("tune # --draws 1", FLIGHTS, ""),
    (
        "discover #",
        &["flight.mvnx", "flight.toml", "empty", "track.csv"],
        "",
    ),
    (
        "view # --out @v.html",
        &["flight.mvnx", "flight.toml", "empty", "track.csv"],
        "",
    ),
    ("stream # --virtual", FLIGHTS, ""),
    ("inspect #", &["flight.mvnx", "empty"], ""),
    (
        "import # --out @out",
        &["empty"],
        "a motion of another system",
    ),
    ("fall #", &["track.csv", "empty"], "a track"),
];

/// What verbs on flights take; a folder without a flight has its own message.
const FLIGHTS: &[&str] = &["flight.mvnx", "flight.toml", "empty"];

#[test]
fn every_verb_names_the_kind_of_file_that_it_got() {
    let folder = tempfile::tempdir().expect("a folder");
    make(folder.path(), Made::Folder("empty"));
    for (name, content, _) in FOUND {
        if !content.is_empty() {
            fs::write(folder.path().join(name), content).expect("a file");
        }
    }
    fs::write(folder.path().join("a.bvh"), "HIERARCHY\n").expect("a file");
    let at = |name: &str| plain(&folder.path().join(name)).to_owned();
    let mut wrong = Vec::new();
    for (call, taken, belongs) in CALLS {
        for (name, _, said) in FOUND {
            if taken.contains(&name) {
                continue;
            }
            // Given as a folder, the subject is the one inside it.
            let said = match (name, belongs) {
                ("empty", "a subject.toml") => "this folder has no subject.toml",
                _ => said,
            };
            let words = call.split(' ').map(|word| match word {
                "#" => at(name),
                word => word.replacen('@', &format!("{}/", at("")), 1),
            });
            let words: Vec<String> = words.collect();
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let (told, code) = PROGRAM.says(&words);
            let belonging = said.ends_with("not ").then(|| format!("{said}{belongs}"));
            let said = belonging.as_deref().unwrap_or(said);
            let has_help = told.contains("help: ");
            if code != Some(2) || !told.contains(said) || !has_help {
                wrong.push(format!("{call} with {name} ({code:?}): {told}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    let left = |path: &str| Path::new(&at(path)).exists();
    assert!(!left("out") && !left("e.csv") && !left("v.html"));
}
