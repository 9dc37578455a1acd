//! The claims of docs/security.md: each names tests, and all of them exist.

use std::collections::BTreeSet;
use std::fs;

use crate::{root, sources};

/// Fewest rows of the table; a page that lost it would pass otherwise.
const FEWEST: usize = 15;

#[test]
fn every_claim_about_security_is_held_by_tests() {
    let page = fs::read_to_string(root().join("docs/security.md")).expect("docs/security.md");
    let (_, table) = page
        .split_once("| claim | tests |")
        .expect("the table of claims");
    let tests: BTreeSet<String> = sources()
        .iter()
        .flat_map(|(_, text)| functions(text))
        .collect();
    let rows = table
        .lines()
        .skip(2)
        .take_while(|line| line.starts_with("| "));
    let mut faults = Vec::new();
    let mut count = 0;
    for row in rows {
        count += 1;
        let (_, cell) = row[2..].split_once(" | ").expect("two cells");
        let named: Vec<&str> = cell
            .split('`')
            .skip(1)
            .step_by(2)
            .filter(|word| word.contains('_') && !word.contains(['.', ' ']))
            .collect();
        if named.is_empty() {
            faults.push(format!("no test: {row}"));
        }
        let missing = named.iter().filter(|name| !tests.contains(**name));
        faults.extend(missing.map(|name| format!("there is no test {name}")));
    }
    assert!(count >= FEWEST, "{count} claims");
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

/// Names of the test functions of a file, those of property tests included.
fn functions(text: &str) -> Vec<String> {
    let mut is_test = false;
    let mut names = Vec::new();
    for line in text.lines().map(str::trim) {
        if line.starts_with("#[test]") {
            is_test = true;
        } else if is_test && let Some(rest) = line.strip_prefix("fn ") {
            let name = rest.split('(').next().unwrap_or_default();
            names.push(name.to_owned());
            is_test = false;
        }
    }
    names
}
