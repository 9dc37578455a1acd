//! What people see: text, tables, progress bars, problems.
//!
//! Names and texts in files and from networks are written by strangers: nothing of them reaches a terminal as a command.

mod bars;
mod visible;

use std::error::Error;
use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::sync::OnceLock;

pub(super) use bars::{FlightBar, Stages, bar, set_share, share_bar, spinner};
use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::input;
use bodyflight::replay::comparison::{Channel, PerChannel};
use comfy_table::{CellAlignment, Table};
use schemars::JsonSchema;
use serde::Serialize;
use visible::{json_without_controls, visible, visible_problem};

/// The first failure to write to standard output, other than that its reader has gone away.
static FAILED: OnceLock<std::io::Error> = OnceLock::new();

/// What the program was called with.
static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Keeps what the program was called with, for what tells where a file comes from.
pub(super) fn keep_arguments(given: impl IntoIterator<Item = OsString>) -> &'static [OsString] {
    ARGUMENTS.get_or_init(|| given.into_iter().collect())
}

/// What the program was called with.
pub(super) fn arguments() -> &'static [OsString] {
    ARGUMENTS.get().map_or(&[], Vec::as_slice)
}

/// Writes a line to standard output. A reader that has gone away is no failure; others end the command, see [`finish`].
pub(super) fn print(text: &str) {
    line(text);
}

/// Writes what a shell is to read, as it is.
pub(super) fn verbatim(text: &str) {
    put(text);
}

/// What a verb answers with `--json`.
#[derive(JsonSchema, Serialize)]
pub(super) struct Answer<'a, T> {
    made_by: MadeBy,
    #[serde(flatten)]
    result: &'a T,
}

/// The run that gave an answer.
#[derive(JsonSchema, Serialize)]
struct MadeBy {
    /// Version of the program.
    version: &'static str,
    /// Its arguments.
    arguments: Vec<String>,
    /// Files that it read.
    inputs: Vec<PathBuf>,
}

/// Writes a result as JSON, beside the run that gave it. `bodyflight schema` has the schema.
///
/// # Errors
/// Returns an error if the result cannot be written as JSON.
pub(super) fn print_json(result: &(impl Serialize + JsonSchema)) -> Result<()> {
    let lossy = |argument: &OsString| argument.to_string_lossy().into_owned();
    let made_by = MadeBy {
        version: env!("CARGO_PKG_VERSION"),
        arguments: arguments().iter().skip(1).map(lossy).collect(),
        inputs: input::claimed(),
    };
    print_plain_json(&Answer { made_by, result })
}

/// Writes a value as JSON, as it is.
///
/// # Errors
/// Returns an error if it cannot be written as JSON.
pub(super) fn print_plain_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(no_json)?;
    put(&json_without_controls(&text));
    Ok(())
}

/// Writes a line of a stream that may have no end; `false` once nobody reads it.
pub(super) fn line(text: &str) -> bool {
    put(&visible(text))
}

/// As [`line()`], a value as JSON on one line.
///
/// # Errors
/// Returns an error if the value cannot be written as JSON.
pub(super) fn json_line(value: &impl Serialize) -> Result<bool> {
    let text = serde_json::to_string(value).map_err(no_json)?;
    Ok(put(&json_without_controls(&text)))
}

fn no_json(error: serde_json::Error) -> Problem {
    Problem::internal("cannot write JSON").caused_by(error)
}

fn put(text: &str) -> bool {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Ok(()) => true,
        Err(error) => {
            if error.kind() != ErrorKind::BrokenPipe {
                let _ = FAILED.set(error);
            }
            false
        }
    }
}

/// To be called once all is written.
///
/// # Errors
/// Returns an error if standard output took less than it was given, as on a full disk.
pub(super) fn finish() -> Result<()> {
    match FAILED.get() {
        None => Ok(()),
        Some(error) => Err(Problem::refused(format!(
            "cannot write to standard output: {error}"
        ))),
    }
}

/// Writes a remark to standard error.
pub(super) fn note(text: &str) {
    let mut err = std::io::stderr().lock();
    let _ = writeln!(err, "{}", visible(text));
}

/// Says that a default person is flown, where a flight names none.
pub(super) fn note_assumed_subject(flight: &Flight) {
    if !flight.has_subject {
        note(&format!(
            "warning: no subject is given: a person of {:.0} kg with equipment is assumed; name one in a flight.toml",
            flight.subject.body().mass()
        ));
    }
}

/// Writes a problem to standard error, with its help; as one line of JSON where that is asked for.
pub(super) fn print_problem(problem: Problem, json: bool) {
    let problem = visible_problem(problem);
    let mut err = std::io::stderr().lock();
    let _ = if json {
        let told = serde_json::json!({ "error": Told::of(&problem) });
        writeln!(err, "{}", json_without_controls(&told.to_string()))
    } else {
        writeln!(err, "{:?}", miette::Report::new(problem))
    };
}

/// Writes what was wrong with the arguments, or the help that was asked for.
pub(super) fn print_usage(error: &clap::Error) -> u8 {
    let is_json = arguments().iter().any(|word| word == "--json");
    if is_json && error.use_stderr() {
        let text = error.render().to_string();
        let (message, help) = text.split_once("\n\n").unwrap_or((&text, ""));
        let flat = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let message = flat(message.trim_start_matches("error: "));
        print_problem(Problem::bad_input(message).help(flat(help)), true);
    } else {
        // A reader that has gone away is no failure.
        let _ = error.print();
    }
    u8::try_from(error.exit_code()).unwrap_or(2)
}

/// A problem for machines.
#[derive(JsonSchema, Serialize)]
pub(super) struct Told {
    exit_code: u8,
    message: String,
    file: Option<String>,
    line: Option<u64>,
    place: Option<String>,
    help: Option<String>,
    causes: Vec<String>,
}

impl Told {
    pub(super) fn of(problem: &Problem) -> Self {
        let causes =
            std::iter::successors(problem.source(), |error: &&dyn Error| (*error).source());
        Self {
            exit_code: problem.kind.exit_code(),
            message: problem.message.clone(),
            file: problem.file.as_ref().map(|file| file.display().to_string()),
            line: problem.line,
            place: problem.place.clone().map(String::from),
            help: problem.help.clone().map(String::from),
            causes: causes.map(ToString::to_string).collect(),
        }
    }
}

/// A table in the plain style of this program.
pub(super) fn table(head: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(comfy_table::presets::UTF8_FULL_CONDENSED);
    table.set_header(head);
    table
}

/// The gap in each channel, beside the size of the channel.
pub(super) fn gap_table(columns: &[(&str, PerChannel)]) -> Table {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut table = table(&[&["channel", "unit"], names.as_slice()].concat());
    for channel in Channel::ALL {
        let (label, unit) = channel.label();
        let numbers = columns
            .iter()
            .map(|(_, values)| format!("{:.3}", values.get(channel)));
        let row: Vec<String> = [label.to_owned(), unit.to_owned()]
            .into_iter()
            .chain(numbers)
            .collect();
        table.add_row(row);
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
