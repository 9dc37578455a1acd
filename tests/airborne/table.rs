//! The table of faults planted in jumps of several people, as in docs/discovery.md. The recordings are public, but most of
//! them are not part of the repository: the page says which they are.

#[path = "table/people.rs"]
mod people;
#[path = "table/plants.rs"]
mod plants;

use std::path::Path;

use bodyflight_tests::program::text;
use serde_json::Value;

use crate::PROGRAM;
use crate::faults::{Capture, planted};
use people::{Person, people};
use plants::{Plant, Row, rows};

/// What the program says of the jumps of a person.
struct Said {
    /// Warnings, or why the jumps are refused.
    words: String,
    /// The effects with their parameters.
    effects: Vec<String>,
}

impl Said {
    /// What is said after the words that name a fault: its size.
    fn size(&self, words: &str) -> Option<&str> {
        let all = self.effects.iter().chain([&self.words]);
        let (_, rest) = all.filter_map(|said| said.split_once(words)).next()?;
        let end = rest.find(['"', ';', '(']).unwrap_or(rest.len());
        Some(rest[..end].trim_matches([' ', ':', ',']))
    }

    /// What else is named: other effects, and faults of other rows.
    fn besides(&self, words: &str, all: &[Row]) -> Vec<&str> {
        let effects = self.effects.iter().map(String::as_str);
        let others = effects.filter(|effect| words.is_empty() || !effect.starts_with(words));
        let faults = all
            .iter()
            .flat_map(|row| row.plants.iter().map(|(_, words)| *words));
        let faults = faults
            .filter(|other| !other.is_empty() && *other != words && self.words.contains(other));
        others.chain(faults).collect()
    }
}

/// Parameters of an effect with their standard errors, in words.
fn parameters(effect: &Value) -> String {
    let name = effect["name"].as_str().unwrap_or_default();
    let each = effect["parameters"].as_object().into_iter().flatten();
    let each = each.map(|(key, value)| {
        let error = effect["standard_errors"][key].as_f64().unwrap_or_default();
        let value = value.as_f64().unwrap_or_default();
        format!(" {key} {value:.4} +- {error:.4}")
    });
    format!("{name}{}", each.collect::<String>())
}

/// Searches the flights; the second half confirms the first.
fn searched(flights: &[String], said_by_import: String) -> Said {
    let (fitted, held_out) = flights.split_at(flights.len().div_ceil(2));
    let mut arguments = vec!["discover", "--json"];
    arguments.extend(fitted.iter().map(String::as_str));
    let held_out = held_out.iter().flat_map(|flight| ["--hold-out", flight]);
    arguments.extend(held_out);
    let output = PROGRAM.run(&arguments);
    let Ok(report) = serde_json::from_slice::<Value>(&output.stdout) else {
        let refusal = text(&output.stderr);
        let words: Vec<&str> = refusal
            .split_whitespace()
            .filter(|word| *word != "│")
            .collect();
        return Said {
            words: format!("{said_by_import} {}", words.join(" ")),
            effects: Vec::new(),
        };
    };
    let effects = report["effects"].as_array().into_iter().flatten();
    Said {
        words: format!("{said_by_import} {}", report["warnings"]),
        effects: effects.map(parameters).collect(),
    }
}

/// What is said of a person's jumps after something is planted.
fn said(person: &Person, folder: &Path, plant: Plant) -> Said {
    let mut of_import = String::new();
    let flights = person.sources.iter().enumerate().map(|(at, source)| {
        let folder = folder.join(at.to_string());
        let wrong = match plant {
            Plant::Subject(wrong) => Some(source.wrong_subject(&folder.join("subject"), wrong)),
            Plant::Frames(..) => None,
        };
        let (capture, doubts) = source.captured(&folder, wrong.as_deref());
        if wrong.is_some() {
            of_import.push_str(&doubts);
        }
        let of_place = |change: fn(&Capture, usize) -> _, rate, keeps_places| {
            planted(&folder, &capture, rate, keeps_places, |frame, _| {
                let frames = &capture.frames;
                let place = frames.iter().position(|other| other.index == frame.index);
                change(&capture, place.expect("a frame of the capture"))
            })
        };
        match plant {
            Plant::Frames(rate, keeps_places, change) => of_place(change, rate, keeps_places),
            Plant::Subject(_) => of_place(|capture, at| capture.frames[at], 1.0, false),
        }
    });
    let flights: Vec<String> = flights.collect();
    searched(&flights, of_import)
}

/// How often the fault of a row is named, of how many times it was planted, and how often something else is.
fn counted(row: &Row, all: &[Row], people: &[Person]) -> [usize; 3] {
    let mut count = [0; 3];
    for (plant, words) in &row.plants {
        for person in people {
            let folder = tempfile::tempdir().expect("a folder");
            let said = said(person, folder.path(), *plant);
            let besides = said.besides(words, all);
            let size = match *words {
                "" => besides.is_empty().then_some(""),
                words => said.size(words),
            };
            println!(
                "{} | {} | {} | {} | {besides:?}",
                row.planted,
                person.name,
                if size.is_some() { "named" } else { "-" },
                size.unwrap_or_default(),
            );
            println!("    {:?} {}", said.effects, said.words);
            count[0] += usize::from(size.is_some());
            count[1] += 1;
            count[2] += usize::from(!besides.is_empty());
        }
    }
    count
}

/// The words of a count as the page has it.
fn cell(row: &Row, [named, planted, _]: [usize; 3]) -> String {
    let cell = match (row.planted, named) {
        ("nothing", _) => format!("nothing in {named} of {planted}"),
        (_, 0) => "none".to_owned(),
        _ => format!("{named} of {planted}"),
    };
    format!("| {} | {cell} |", row.planted)
}

#[test]
#[ignore = "needs the recordings in the folder named by BODYFLIGHT_JUMPS"]
fn faults_planted_in_public_jumps_are_named_as_the_page_says() {
    let folder = std::env::var_os("BODYFLIGHT_JUMPS").expect("BODYFLIGHT_JUMPS");
    let only = std::env::var("BODYFLIGHT_PLANTED").unwrap_or_default();
    let people = people(Path::new(&folder));
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/discovery.md"));
    let page = page.expect("the page");
    let all = rows();
    let mut wrong = Vec::new();
    let mut sum = [0; 3];
    for row in all.iter().filter(|row| row.planted.contains(&only)) {
        let count = counted(row, &all, &people);
        let cell = cell(row, count);
        println!("{cell}");
        if !page.contains(&cell) {
            wrong.push(cell);
        }
        if row.planted != "nothing" {
            sum = [0, 1, 2].map(|part| sum[part] + count[part]);
        }
    }
    let [named, planted, falsely] = sum;
    println!("{named} of {planted} named, something else in {falsely}");
    assert!(wrong.is_empty(), "the page differs: {wrong:#?}");
}
