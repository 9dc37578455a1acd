//! Scores in a file, one flight a line, so that a run of hours can be made in pieces; and the table of the page.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::score::{HEAD, Score};

/// A flight of the table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Case {
    /// Size of the joint errors.
    pub(super) degrees: f64,
    /// How they act.
    pub(super) kind: &'static str,
    pub(super) maneuver: &'static str,
    pub(super) seed: u64,
}

impl Case {
    /// The row of the table to which it belongs.
    pub(super) fn row(&self) -> String {
        format!("{} {}", self.degrees, self.kind)
    }

    fn is_of(&self, line: &Value) -> bool {
        line["row"] == self.row() && line["maneuver"] == self.maneuver && line["seed"] == self.seed
    }
}

/// The scores of flights, by each method, and the file that keeps them.
pub(super) struct Kept {
    lines: Vec<Value>,
    file: Option<PathBuf>,
}

impl Kept {
    /// Reads a file if there is one.
    pub(super) fn read(file: Option<PathBuf>) -> Self {
        let text = file
            .as_ref()
            .and_then(|file| std::fs::read_to_string(file).ok())
            .unwrap_or_default();
        let lines = text.lines();
        let lines = lines
            .map(|line| serde_json::from_str(line).expect("a line of scores"))
            .collect();
        Self { lines, file }
    }

    pub(super) fn has(&self, case: &Case) -> bool {
        self.lines.iter().any(|line| case.is_of(line))
    }

    pub(super) fn keep(&mut self, case: &Case, scores: &[Score; 2]) {
        let line = json!({
            "row": case.row(),
            "maneuver": case.maneuver,
            "seed": case.seed,
            "scores": scores.each_ref().map(Score::to_json),
        });
        if let Some(file) = &self.file {
            let mut options = std::fs::OpenOptions::new();
            let mut file = options
                .create(true)
                .append(true)
                .open(file)
                .expect("the file of scores");
            writeln!(file, "{line}").expect("the file of scores");
        }
        self.lines.push(line);
    }

    /// The scores of a flight by each method.
    pub(super) fn scores(&self, case: &Case) -> Option<[Score; 2]> {
        let line = self.lines.iter().find(|line| case.is_of(line))?;
        let [filter, smoother] = [0, 1].map(|k| Score::from_json(&line["scores"][k]));
        Some([filter?, smoother?])
    }
}

/// Replaces the table of `docs/estimator.md`.
pub(super) fn write(rows: &[String]) {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/estimator.md");
    let text = std::fs::read_to_string(&page).expect("the page");
    let (before, rest) = text.split_once(HEAD).expect("the table of the page");
    let rest = rest.trim_start_matches('\n');
    let after: String = rest
        .split_inclusive('\n')
        .skip_while(|line| line.starts_with('|'))
        .collect();
    let text = format!("{before}{HEAD}\n{}\n{after}", rows.join("\n"));
    std::fs::write(&page, text).expect("the page");
}
