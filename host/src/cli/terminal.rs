//! Terminal output: text, tables, progress bars, errors.
//!
//! Names and texts from files and networks are not trusted: none of their control characters reach the terminal.

mod bars;
mod sheet;
mod visible;

use std::borrow::Cow;
use std::ffi::OsString;
use std::io::{ErrorKind, Write};
use std::path::PathBuf;
use std::sync::OnceLock;

use super::arguments::in_words;
pub(super) use bars::{FlightBar, Stages, bar, set_share, share_bar, spinner};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::input;
use bodyflight_mvnx::recording::Warning;
use bodyflight_replay::comparison::{Channel, PerChannel};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::model_file::Effects;
use console::style;
use serde::Serialize;
use sheet::Sheet;
use visible::{json_without_controls, visible, visible_problem};

/// The first failure to write to standard output, other than a closed pipe.
static FAILED: OnceLock<std::io::Error> = OnceLock::new();

/// The program's arguments.
static ARGUMENTS: OnceLock<Vec<OsString>> = OnceLock::new();

/// Stores the program's arguments, to be quoted in outputs that name the run.
pub(super) fn keep_arguments(given: impl IntoIterator<Item = OsString>) -> &'static [OsString] {
    ARGUMENTS.get_or_init(|| given.into_iter().collect())
}

/// The program's arguments.
pub(super) fn arguments() -> &'static [OsString] {
    ARGUMENTS.get().map_or(&[], Vec::as_slice)
}

/// The program's arguments as text, without its name.
pub(super) fn argument_texts() -> Vec<String> {
    let lossy = |argument: &OsString| argument.to_string_lossy().into_owned();
    arguments().iter().skip(1).map(lossy).collect()
}

/// Writes a line to standard output. A closed pipe is not an error; [`finish`] reports other failures.
pub(super) fn print(text: &str) {
    line(text);
}

/// Writes text for a shell, unchanged.
#[cfg(feature = "full")]
pub(super) fn verbatim(text: &str) {
    put(text);
}

/// The answer of a verb with `--json`.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Answer<'a, T> {
    made_by: MadeBy,
    #[serde(flatten)]
    result: &'a T,
}

/// The run that produced an answer.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct MadeBy {
    /// Version of the program.
    version: &'static str,
    /// Its arguments.
    arguments: Vec<String>,
    /// Files that it read.
    inputs: Vec<PathBuf>,
}

/// Writes a result as JSON, together with the run that produced it. `bodyflight schema` prints the schema.
///
/// # Errors
/// Returns an error if the result cannot be written as JSON.
pub(super) fn print_json(result: &impl Serialize) -> Result<()> {
    let made_by = MadeBy {
        version: env!("CARGO_PKG_VERSION"),
        arguments: argument_texts(),
        inputs: input::claimed(),
    };
    print_plain_json(&Answer { made_by, result })
}

/// Writes a value as JSON, without `made_by`.
///
/// # Errors
/// Returns an error if it cannot be written as JSON.
pub(super) fn print_plain_json(value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value).map_err(no_json)?;
    put(&json_without_controls(&text));
    Ok(())
}

/// Writes a line of a stream that may be endless; returns `false` once the pipe is closed.
pub(super) fn line(text: &str) -> bool {
    put(&visible(text))
}

/// Same as [`line()`], for a value as JSON on one line.
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

/// Reports a failure to write to standard output. Call this after all output.
///
/// # Errors
/// Returns an error if standard output could not be written completely, for example because the disk is full.
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

/// Writes what is implausible in a recording to standard error.
pub(super) fn note_warnings(warnings: &[Warning]) {
    for warning in warnings {
        note(&format!("warning: {warning}"));
    }
}

/// Warns about effects of which only the mean is simulated.
pub(super) fn note_random(effects: &Effects) {
    for (effect, _) in effects
        .named
        .iter()
        .filter(|(effect, _)| effect.is_random())
    {
        note(&format!(
            "warning: {} changes at random: the model uses its mean, which has no effect",
            effect.description().name
        ));
    }
}

/// Warns that a default person is assumed, if the flight names none.
pub(super) fn note_assumed_subject(flight: &Flight) {
    if !flight.has_subject {
        note(&format!(
            "warning: no subject was given: assuming a person of {:.0} kg with equipment; name a subject in flight.toml",
            flight.subject.body().mass()
        ));
    }
}

/// Writes a problem and its help to standard error, on request as one line of JSON.
pub(super) fn print_problem(problem: Problem, json: bool) {
    let problem = visible_problem(problem);
    let mut err = std::io::stderr().lock();
    let _ = if json {
        let told = serde_json::json!({ "error": Told::of(&problem) });
        writeln!(err, "{}", json_without_controls(&told.to_string()))
    } else {
        err.write_all(told(&problem).as_bytes())
    };
}

/// A problem, its causes and the next step, each on its own line.
fn told(problem: &Problem) -> String {
    let label = |text: &'static str| style(text).for_stderr().bold();
    let mut text = format!("{} {problem}\n", label("error:").red());
    for cause in problem.causes() {
        text += &format!("  {} {cause}\n", label("cause:"));
    }
    if let Some(help) = &problem.help {
        text += &format!("  {} {help}\n", label("help:").cyan());
    }
    text
}

/// Writes what was wrong with the arguments, or the requested help.
pub(super) fn print_usage(error: &clap::Error) -> u8 {
    let is_json = arguments().iter().any(|word| word == "--json");
    if is_json && error.use_stderr() {
        let text = in_words(&error.render().to_string());
        let (message, help) = text.split_once("\n\n").unwrap_or((&text, ""));
        let flat = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let message = flat(message.trim_start_matches("error: "));
        print_problem(Problem::bad_input(message).help(flat(help)), true);
    } else if error.use_stderr() {
        let plain = error.render().to_string();
        let text = match visible(&plain) {
            Cow::Borrowed(_) => styled(&error.render()),
            // An argument would be obeyed as colours are.
            Cow::Owned(text) => text,
        };
        let _ = write!(std::io::stderr().lock(), "{}", in_words(&text));
    } else {
        // A closed pipe is not an error.
        let _ = error.print();
    }
    u8::try_from(error.exit_code()).unwrap_or(2)
}

/// A message of the parser of arguments, with colours if standard error shows them.
fn styled(message: &clap::builder::StyledStr) -> String {
    #[cfg(feature = "full")]
    if console::colors_enabled_stderr() {
        return message.ansi().to_string();
    }
    message.to_string()
}

/// A problem, machine-readable.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
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
        Self {
            exit_code: problem.kind.exit_code(),
            message: problem.message.clone(),
            file: problem.file.as_ref().map(|file| file.display().to_string()),
            line: problem.line,
            place: problem.place.clone().map(String::from),
            help: problem.help.clone().map(String::from),
            causes: problem.causes().map(ToString::to_string).collect(),
        }
    }
}

/// A table in the program's style.
pub(super) fn table(head: &[&str]) -> Sheet {
    Sheet::new(head)
}

/// A table of values per channel, one column for each entry.
pub(super) fn gap_table(columns: &[(&str, PerChannel)]) -> Sheet {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut table = table(&[&["channel", "unit"], names.as_slice()].concat()).right_from(2);
    for channel in Channel::ALL {
        let (label, unit) = channel.label();
        let numbers =
            columns
                .iter()
                .map(|(_, values)| values.get(channel))
                .map(|value| match value.is_nan() {
                    true => "-".to_owned(),
                    false => format!("{value:.3}"),
                });
        table.add_row(
            [label.to_owned(), unit.to_owned()]
                .into_iter()
                .chain(numbers),
        );
    }
    table
}
