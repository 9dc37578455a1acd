//! Jumps in captures of many people and sources, listed in a table: how well the models predict them, by source.
//!
//! Captures that cannot be used are counted with the reason, so that a table that others share may name files that not
//! everybody has.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::{input, progress};
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::systems::is_of_another_system;
use bodyflight_replay::recorded::Recorded;
use bodyflight_replay::subject::Subject;
use serde::{Deserialize, Serialize};

use super::bundled;
use super::windows::{self, Row, predicted};
use crate::airborne::physics::Fall;
use crate::airborne::verdict::combined;
use crate::airborne::{Capture, Part};
use crate::import::{Request, import};

/// Length of the windows that are predicted (s).
pub const LENGTH: f64 = 0.25;
/// The line that begins an entry, by which a table is recognised.
const ENTRY: &str = "[[captures]]";
/// Name of the row over all sources.
pub const ALL: &str = "all";

/// A table of captures.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    captures: Vec<Entry>,
}

/// A capture; paths are relative to the table.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    /// Laboratory or collection.
    source: String,
    /// The person, by a name that is unique in the source.
    person: String,
    /// A recording, a flight.toml, or a file of another system.
    file: PathBuf,
    /// A mapping, for files of other systems.
    mapping: Option<PathBuf>,
    /// The person's measures: a subject.toml.
    subject: Option<PathBuf>,
    /// Begin and end (s) of times in the air; others are not used.
    phases: Option<Vec<[f64; 2]>>,
}

/// Jumps by source.
#[derive(Debug, Clone, Default, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Captures {
    /// A row for each source, and one for all of them if there are several.
    pub sources: Vec<Source>,
    /// Captures that were not used.
    pub skipped: Vec<Skipped>,
}

/// The jumps of a source.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Source {
    /// Its name.
    pub source: String,
    /// Number of people.
    pub people: usize,
    /// Number of captures.
    pub captures: usize,
    /// Number of times in the air.
    pub phases: usize,
    /// Their length together (s).
    pub airborne_s: f64,
    /// Gravity from all of them (m/s2).
    pub g_mps2: Option<f64>,
    /// Its standard error (m/s2), from the differences between phases if they are larger than their own errors.
    pub g_standard_error_mps2: Option<f64>,
    /// Errors of the attitude predicted over 0.25 s, by model.
    pub predictions: Vec<Row>,
}

/// A capture that was not used.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Skipped {
    /// Its source.
    pub source: String,
    /// Its file.
    pub file: PathBuf,
    /// Why.
    pub reason: String,
}

/// Whether a file is a table of captures.
pub fn is_table(path: &Path) -> bool {
    let is_toml = path.extension().is_some_and(|end| end == "toml");
    is_toml && path.is_file() && input::text(path).is_ok_and(|text| text.contains(ENTRY))
}

/// The parts of one capture in the air, and whose they are.
struct Used {
    source: String,
    person: String,
    parts: Vec<Part>,
}

/// Reads the captures of tables, and predicts their times in the air.
///
/// # Errors
/// Returns an error if a table is unusable, or Ctrl-C was pressed.
pub fn judged(tables: &[PathBuf]) -> Result<Captures> {
    let mut entries = Vec::new();
    for path in tables {
        let text = input::text(path)?;
        let table: Table =
            toml::from_str(&text).map_err(|error| Problem::toml(&error, &text, path))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        entries.extend(table.captures.into_iter().map(|entry| entry.within(folder)));
    }
    let (mut used, mut skipped) = (Vec::new(), Vec::new());
    for (k, entry) in entries.iter().enumerate() {
        progress::stage(format!("{}", entry.file.display()));
        progress::reached(k, entries.len())?;
        let found = match entry.parts() {
            Ok(parts) if parts.is_empty() => Err("nothing in the air was found".to_owned()),
            Ok(parts) => Ok(parts),
            Err(problem) => Err(problem.to_string()),
        };
        match found {
            Ok(parts) => used.push(Used {
                source: entry.source.clone(),
                person: entry.person.clone(),
                parts,
            }),
            Err(reason) => skipped.push(Skipped {
                source: entry.source.clone(),
                file: entry.file.clone(),
                reason,
            }),
        }
    }
    let mut names: Vec<&str> = Vec::new();
    for one in &used {
        if !names.contains(&one.source.as_str()) {
            names.push(&one.source);
        }
    }
    let mut sources = Vec::new();
    for name in &names {
        let of: Vec<&Used> = used.iter().filter(|used| used.source == *name).collect();
        sources.push(Source::of(name, &of)?);
    }
    if names.len() > 1 {
        sources.push(Source::of(ALL, &used.iter().collect::<Vec<_>>())?);
    }
    Ok(Captures { sources, skipped })
}

impl Entry {
    /// The same with paths from where the program runs.
    fn within(self, folder: &Path) -> Self {
        let at = |path: PathBuf| folder.join(path);
        Self {
            file: at(self.file),
            mapping: self.mapping.map(at),
            subject: self.subject.map(at),
            ..self
        }
    }

    fn parts(&self) -> Result<Vec<Part>> {
        if !self.file.exists() {
            return Err(Problem::bad_input("the file is absent"));
        }
        let mapping = self.mapping.as_deref().map(Mapping::read).transpose()?;
        let capture = if mapping.is_some() || is_of_another_system(&self.file) {
            let folder = bundled::temporary()?;
            let subject = self.subject.as_deref().map(Subject::read).transpose()?;
            let request = Request {
                file: &self.file,
                mapping: mapping.as_ref(),
                subject: &subject.clone().unwrap_or_default(),
                has_subject: subject.is_some(),
                folder: folder.path(),
            };
            Capture::read(&import(&request, &mut |_| {})?.flight)?
        } else {
            Capture::read(&self.file)?
        };
        let mut parts = capture.into_parts();
        if let Some(phases) = &self.phases {
            let middle = |part: &Part| part.begin_s + 0.5 * part.length_s;
            let is_listed = |part: &Part| {
                let mut phases = phases.iter();
                phases.any(|[begin, end]| (*begin..*end).contains(&middle(part)))
            };
            parts.retain(is_listed);
        }
        Ok(parts)
    }
}

impl Source {
    fn of(name: &str, used: &[&Used]) -> Result<Self> {
        let people: BTreeSet<(&str, &str)> = (used.iter())
            .map(|used| (used.source.as_str(), used.person.as_str()))
            .collect();
        let parts: Vec<&Part> = used.iter().flat_map(|used| &used.parts).collect();
        let falls: Vec<Fall> = parts.iter().map(|part| part.fall).collect();
        let recorded: Vec<&Recorded> = parts.iter().map(|part| &part.recorded).collect();
        let gravity = combined(&falls);
        let mut predictions = Vec::new();
        for model in windows::MODELS {
            predictions.extend(predicted(&recorded, LENGTH, model)?);
        }
        Ok(Self {
            source: name.to_owned(),
            people: people.len(),
            captures: used.len(),
            phases: parts.len(),
            airborne_s: parts.iter().map(|part| part.length_s).sum(),
            g_mps2: gravity.map(|(mean, _)| mean.norm()),
            g_standard_error_mps2: gravity.map(|(_, error)| error),
            predictions,
        })
    }
}
