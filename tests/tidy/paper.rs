//! The claims of docs/paper.md: every figure of the paper is listed, and the commands and tests exist.

use std::collections::BTreeSet;
use std::fs;

use crate::{root, sources};

/// Fewest rows about what the text of the paper mentions; a page that lost them would pass otherwise.
const FEWEST: usize = 12;

/// Labels of the paper's figures; `None` if the paper is absent.
fn figures() -> Option<BTreeSet<String>> {
    let path = bodyflight_shared_data::shared("paper/skydiver-model.tex")?;
    let text = fs::read_to_string(path).expect("the paper");
    let labels = text.split("\\label{").skip(1);
    let labels = labels.filter_map(|rest| rest.split('}').next());
    Some(
        labels
            .filter(|label| label.starts_with("fig:"))
            .map(str::to_owned)
            .collect(),
    )
}

/// What is wrong with a command of the page, such as `bodyflight reproduce tracking`; `texts` are all sources.
fn fault(command: &str, texts: &str) -> Option<String> {
    let words: Vec<&str> = command.split(' ').collect();
    let ["bodyflight", verb, rest @ ..] = words.as_slice() else {
        return Some(format!("`{command}` is no command of the program"));
    };
    if !root().join(format!("host/src/cli/{verb}.rs")).is_file() {
        return Some(format!("`{command}`: there is no verb {verb}"));
    }
    let unknown = rest.iter().find(|word| {
        let name = word.trim_start_matches('-');
        let option = name != **word;
        let field = format!("    {}:", name.replace('-', "_"));
        !(texts.contains(&format!("\"{name}\"")) || option && texts.contains(&field))
    });
    unknown.map(|word| format!("`{command}`: no source names {word}"))
}

#[test]
fn the_map_of_the_paper_is_complete_and_true() {
    let page = fs::read_to_string(root().join("docs/paper.md")).expect("docs/paper.md");
    let (drawn, mentioned) = page
        .split_once("## What the text mentions")
        .expect("the second table");
    let rows = |text: &str| -> Vec<Vec<String>> {
        let rows = text.lines().filter(|line| line.starts_with("| "));
        let rows = rows.filter(|line| line.contains("` |"));
        rows.map(|row| row.split(" | ").map(str::to_owned).collect())
            .collect()
    };
    let (drawn, mentioned) = (rows(drawn), rows(mentioned));
    assert!(mentioned.len() >= FEWEST, "{} rows", mentioned.len());
    if let Some(figures) = figures() {
        let listed: Vec<String> = drawn
            .iter()
            .map(|row| row[0].trim_matches(['|', ' ', '`']).to_owned())
            .collect();
        let set: BTreeSet<String> = listed.iter().cloned().collect();
        assert_eq!(set.len(), listed.len(), "a label stands twice");
        assert_eq!(set, figures);
    }
    let texts: String = sources().into_iter().map(|(_, text)| text).collect();
    let mut faults = Vec::new();
    for row in drawn.iter().chain(&mentioned) {
        let [_, _, command, test, ..] = row.as_slice() else {
            panic!("a broken row: {row:?}")
        };
        let test = test.trim_matches(['|', ' ', '`']);
        if !texts.contains(&format!("fn {test}(")) {
            faults.push(format!("there is no test {test}"));
        }
        if command != "-" {
            faults.extend(fault(command.trim_matches('`'), &texts));
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_command_that_does_not_exist_is_found() {
    let texts = "name: \"tracking\",\n    preset: String,\n";
    for (command, right) in [
        ("bodyflight reproduce tracking", true),
        ("bodyflight reproduce trackin", false),
        ("bodyflight reproduces tracking", false),
        ("bodyflight estimate --preset tracking", true),
        ("bodyflight estimate --prset tracking", false),
    ] {
        assert_eq!(fault(command, texts).is_none(), right, "{command}");
    }
}
