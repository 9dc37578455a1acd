//! The table of faults planted in jumps of several people, as in docs/discovery.md. The recordings are public, but most of
//! them are not part of the repository: the page says which they are.

#[path = "table/people.rs"]
mod people;
#[path = "table/plants.rs"]
mod plants;

use std::path::{Path, PathBuf};

use bodyflight_core::dynamics::State;
use bodyflight_tests::program::text;
use bodyflight_verbs::airborne::{Capture, Part, physics};
use nalgebra::Vector3;
use serde_json::Value;

use crate::PROGRAM;
use crate::faults::planted;
use people::{Person, bundled, others, people};
use plants::{Plant, Row, Words, rows};

/// What the program says of the jumps of a person.
struct Said {
    /// Warnings, or why the jumps are refused.
    words: String,
    /// The effects with their parameters.
    effects: Vec<String>,
}

impl Said {
    /// What is said after each of the words that name a fault: its sizes.
    fn sizes(&self, words: Words) -> Vec<&str> {
        let of = |words: &&str| {
            let mut all = self.effects.iter().chain([&self.words]);
            let (_, rest) = all.find_map(|said| said.split_once(*words))?;
            let end = rest.find(['"', ';', '(']).unwrap_or(rest.len());
            Some(rest[..end].trim_matches([' ', ':', ',']))
        };
        words.iter().filter_map(of).collect()
    }

    /// What else is named: other effects, and faults of other rows.
    fn besides(&self, words: Words, all: &[Row]) -> Vec<&str> {
        let is_other = |said: &str| !words.iter().any(|own| said.starts_with(own));
        let effects = self.effects.iter().map(String::as_str);
        let known = all.iter().flat_map(|row| row.plants.iter());
        let faults = known.flat_map(|(_, words)| words.iter().copied());
        let faults = faults.filter(|other| self.words.contains(other));
        effects
            .chain(faults)
            .filter(|said| is_other(said))
            .collect()
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
        std::fs::create_dir_all(&folder).expect("a folder");
        match plant {
            Plant::Subject(wrong) => {
                let subject = source.wrong_subject(&folder.join("subject"), wrong);
                let (flight, said) = source.with_subject(&folder, &subject);
                of_import.push_str(&said);
                flight
            }
            Plant::Frames(rate, keeps_places, change) => {
                let capture = source.captured(&folder);
                let frames = &capture.frames;
                planted(&folder, &capture, rate, keeps_places, |frame, _| {
                    let place = frames.iter().position(|other| other.index == frame.index);
                    change(&capture, place.expect("a frame of the capture"))
                })
            }
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
            let sizes = said.sizes(words);
            let is_right = if words.is_empty() {
                besides.is_empty()
            } else {
                !sizes.is_empty()
            };
            let mark = if is_right { "named" } else { "-" };
            println!(
                "{} | {} | {mark} | {sizes:?} | {besides:?}",
                row.planted, person.name
            );
            println!("    {:?} {}", said.effects, said.words);
            count[0] += usize::from(is_right);
            count[1] += 1;
            count[2] += usize::from(!besides.is_empty());
        }
    }
    count
}

/// The words of the counts as the page has them: of the people with whom the checks were made, and of others.
fn cells(row: &Row, counts: [[usize; 3]; 2]) -> String {
    let cell = |[named, planted, _]: [usize; 3]| match (row.planted, named) {
        ("nothing", _) => format!("nothing in {named} of {planted}"),
        (_, 0) => "none".to_owned(),
        _ => format!("{named} of {planted}"),
    };
    let [here, there] = counts.map(cell);
    format!("| {} | {here} | {there} |", row.planted)
}

/// The folder of the repositories, and the page.
fn folder() -> PathBuf {
    PathBuf::from(std::env::var_os("BODYFLIGHT_JUMPS").expect("BODYFLIGHT_JUMPS"))
}

fn page() -> String {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/discovery.md");
    std::fs::read_to_string(page).expect("the page")
}

/// What two jumps of 0.4 s show too: not their rate, nor that the whole body is turned.
#[test]
fn faults_planted_in_bundled_jumps_are_named() {
    let all = rows();
    let is_shown = |row: &&Row| !row.planted.contains("rate 2 %") && !row.planted.contains("whole");
    for row in all.iter().filter(is_shown) {
        let [named, planted, falsely] = counted(row, &all, &bundled());
        assert_eq!([named, falsely], [planted, 0], "{}", row.planted);
    }
}

#[test]
#[ignore = "needs the recordings in the folder named by BODYFLIGHT_JUMPS"]
fn faults_planted_in_public_jumps_are_named_as_the_page_says() {
    let only = std::env::var("BODYFLIGHT_PLANTED").unwrap_or_default();
    let people = [people(&folder()), others(&folder())];
    let page = page();
    let all = rows();
    let (mut table, mut wrong) = (Vec::new(), Vec::new());
    let mut sums = [[0; 3]; 2];
    for row in all.iter().filter(|row| row.planted.contains(&only)) {
        let counts = [0, 1].map(|set| counted(row, &all, &people[set]));
        let cells = cells(row, counts);
        if !page.contains(&cells) {
            wrong.push(cells.clone());
        }
        table.push(cells);
        if row.planted != "nothing" {
            sums = [0, 1].map(|set| [0, 1, 2].map(|part| sums[set][part] + counts[set][part]));
        }
    }
    println!("{}", table.join("\n"));
    for [named, planted, falsely] in sums {
        let says = format!("{named} of {planted} named, something else in {falsely}");
        println!("{says}");
        if only.is_empty() && !page.contains(&says) {
            wrong.push(says);
        }
    }
    assert!(wrong.is_empty(), "the page differs: {wrong:#?}");
}

/// Gravity in a part without so much of both ends (s), and its weight.
fn gravity(part: &Part, ends: f64) -> Option<(f64, f64)> {
    let samples = &part.recorded.samples;
    let within = part.begin_s + ends - 1e-6..part.begin_s + part.length_s - ends + 1e-6;
    let frames = (0..samples.len()).filter(|frame| within.contains(&samples[*frame].time));
    let centre = |frame: usize| -> Vector3<f64> {
        let rate = part.recorded.rate(frame);
        let sample = part
            .recorded
            .dynamics
            .sample(&samples[frame].posture, &rate);
        State::from_motion(&samples[frame].motion, &sample)
            .cg_position
            .components
    };
    let (times, centres): (Vec<f64>, Vec<_>) = frames
        .map(|frame| (samples[frame].time, centre(frame)))
        .unzip();
    let length = times.last()? - times.first()?;
    let fall = physics::fall(&times, &centres)?;
    Some((fall.g_mps2, length.powi(4)))
}

#[test]
#[ignore = "needs the recordings in the folder named by BODYFLIGHT_JUMPS"]
fn gravity_in_the_middle_of_public_jumps_is_as_the_page_says() {
    let page = page();
    let mut wrong = Vec::new();
    for person in people(&folder()).iter().skip(2) {
        let out = tempfile::tempdir().expect("a folder");
        let parts = person.sources.iter().enumerate().flat_map(|(at, source)| {
            let flight = source.flight(&out.path().join(at.to_string()));
            let capture = Capture::read(Path::new(&flight)).expect("a capture");
            capture.into_parts()
        });
        let parts: Vec<Part> = parts.collect();
        let mean = |ends: f64| {
            let each = parts.iter().filter_map(|part| gravity(part, ends));
            let [sum, weights] = each.fold([0.0; 2], |[sum, weights], (g, weight)| {
                [sum + g * weight, weights + weight]
            });
            sum / weights
        };
        let row = format!("| {} | {:.2} | {:.2} |", person.name, mean(0.0), mean(0.06));
        println!("{row}");
        if !page.contains(&row) {
            wrong.push(row);
        }
    }
    assert!(wrong.is_empty(), "the page differs: {wrong:#?}");
}
