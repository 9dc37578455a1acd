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

    /// Keeps the scores of a flight, or that it could not be flown.
    pub(super) fn keep(&mut self, case: &Case, scores: Option<&[Score; 2]>) {
        let line = json!({
            "row": case.row(),
            "maneuver": case.maneuver,
            "seed": case.seed,
            "scores": scores.map(|scores| scores.each_ref().map(Score::to_json)),
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

/// Columns of a row that the page shows.
const SHOWN: usize = 7;

/// Replaces rows of the table of `docs/estimator.md` by those that were flown, and adds new ones.
pub(super) fn write(rows: &[String]) {
    let shown = |row: &String| row.split_inclusive('|').take(SHOWN + 1).collect::<String>();
    let mut rows: Vec<String> = rows.iter().map(shown).collect();
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/estimator.md");
    let text = std::fs::read_to_string(&page).expect("the page");
    let head: Vec<String> = HEAD.lines().map(|line| shown(&line.to_owned())).collect();
    let head = head.join("\n");
    let (before, rest) = text.split_once(&head).expect("the table of the page");
    let rest = rest.trim_start_matches('\n');
    let end = rest.find("\n\n").expect("text below the table");
    let (present, after) = rest.split_at(end);
    // The size of the joint errors and the method.
    let name = |row: &str| {
        row.split('|')
            .take(3)
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    let mut table: Vec<String> = present.lines().map(str::to_owned).collect();
    for row in &mut table {
        if let Some(place) = rows.iter().position(|flown| name(flown) == name(row)) {
            *row = rows.remove(place);
        }
    }
    table.append(&mut rows);
    let text = format!("{before}{head}\n{}{after}", table.join("\n"));
    std::fs::write(&page, text).expect("the page");
}
