//! What people see: text, tables, progress bars, problems.
//!
//! Names and texts in files and from networks are written by strangers: nothing of them reaches a terminal as a command.

mod visible;

use std::error::Error;
use std::ffi::OsString;
use std::io::{ErrorKind, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Duration;

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::formats::flight::Flight;
use bodyflight::formats::input;
use bodyflight::replay::comparison::{Channel, PerChannel};
use comfy_table::{CellAlignment, Table};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use schemars::JsonSchema;
use serde::Serialize;
use visible::{json_without_controls, visible, visible_problem};

/// The first failure to write to standard output, other than that its reader has gone away.
static FAILED: OnceLock<std::io::Error> = OnceLock::new();

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
    let lossy = |argument: OsString| argument.to_string_lossy().into_owned();
    let made_by = MadeBy {
        version: env!("CARGO_PKG_VERSION"),
        arguments: std::env::args_os().skip(1).map(lossy).collect(),
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

/// A problem for machines.
#[derive(Serialize)]
struct Told<'a> {
    exit_code: u8,
    message: &'a str,
    file: Option<String>,
    line: Option<u64>,
    place: Option<&'a str>,
    help: Option<&'a str>,
    causes: Vec<String>,
}

impl<'a> Told<'a> {
    fn of(problem: &'a Problem) -> Self {
        let causes =
            std::iter::successors(problem.source(), |error: &&dyn Error| (*error).source());
        Self {
            exit_code: problem.kind.exit_code(),
            message: &problem.message,
            file: problem.file.as_ref().map(|file| file.display().to_string()),
            line: problem.line,
            place: problem.place.as_deref(),
            help: problem.help.as_deref(),
            causes: causes.map(ToString::to_string).collect(),
        }
    }
}

/// A bar for work of known length, on a terminal only.
pub(super) fn bar(length: u64, what: &'static str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta}");
    let bar = new_bar(Some(length));
    if let Ok(style) = style {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar
}

/// A bar for work of which only a share can be told, in thousandths, on a terminal only.
pub(super) fn share_bar(what: &'static str) -> ProgressBar {
    let bar = new_bar(Some(1000));
    if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {percent} %, {eta} left") {
        bar.set_style(style);
    }
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(250));
    bar
}

/// A spinner for work of unknown length, on a terminal only.
pub(super) fn spinner(what: &'static str) -> ProgressBar {
    let bar = new_bar(None);
    bar.set_message(what);
    bar.enable_steady_tick(Duration::from_millis(120));
    bar
}

fn new_bar(length: Option<u64>) -> ProgressBar {
    let target = if std::io::stderr().is_terminal() {
        ProgressDrawTarget::stderr()
    } else {
        ProgressDrawTarget::hidden()
    };
    ProgressBar::with_draw_target(length, target)
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
