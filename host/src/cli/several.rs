//! Several flights in one call, one after another; a failure of one does not stop the others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Kind, Problem, Result};
use bodyflight_replay::flight::name_of;
use serde::Serialize;

use super::terminal;

/// The placeholder for the flight's name in names of outputs.
const NAME: &str = "{}";

/// The file that a flight is read from: `flight.toml` if `flight` is a folder, otherwise `flight` itself.
pub(super) fn file_of(flight: &Path) -> PathBuf {
    if flight.is_dir() {
        flight.join("flight.toml")
    } else {
        flight.to_path_buf()
    }
}

/// The name of a flight, even if its path is relative, such as `.`.
fn name(flight: &Path) -> String {
    name_of(
        &flight
            .canonicalize()
            .unwrap_or_else(|_| flight.to_path_buf()),
    )
}

/// The output file for one of `flights`; if there are several, each has its own.
///
/// # Errors
/// Returns an error if several flights would write the same file.
pub(super) fn output_of(
    output: Option<&PathBuf>,
    flight: &Path,
    flights: &[PathBuf],
) -> Result<Option<PathBuf>> {
    let Some(output) = output else {
        return Ok(None);
    };
    let text = output.to_string_lossy();
    if flights.len() > 1 {
        if !text.contains(NAME) {
            return Err(Problem::bad_input(
                "expected {} in the name of the output, as there are several flights",
            )
            .in_file(output)
            .help("{} is replaced by the name of the flight, as in {}.csv"));
        }
        let mut named = BTreeMap::new();
        for other in flights {
            if let Some(before) = named.insert(name(other), other) {
                return Err(Problem::bad_input(format!(
                    "this flight and {} have the same name, and would write the same file",
                    before.display()
                ))
                .in_file(other)
                .help("run the program once for each"));
            }
        }
    }
    Ok(Some(PathBuf::from(text.replace(NAME, &name(flight)))))
}

/// The end of a verb whose result may be doubtful.
///
/// # Errors
/// Returns the doubt, if there is one.
pub(super) fn verdict(doubt: Option<String>, path: &Path) -> Result<()> {
    match doubt {
        None => Ok(()),
        Some(doubt) => Err(Problem::doubt(doubt).in_file(path)),
    }
}

/// Results for several flights, in the order given.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Several<R> {
    flights: Vec<Outcome<R>>,
}

/// The result for one of several flights.
#[derive(Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub(super) struct Outcome<R> {
    flight: PathBuf,
    /// The result; null if there is none.
    pub(super) report: Option<R>,
    /// The problem, if there was one.
    error: Option<terminal::Told>,
}

/// Calls `work` for each flight. It returns the value to print as JSON; without `--json` it prints its result itself.
///
/// # Errors
/// Returns the error of a single flight. Several flights are all processed before an error is returned, except after
/// Ctrl-C.
pub(super) fn each<R: Serialize>(
    flights: &[PathBuf],
    json: bool,
    mut work: impl FnMut(&Path) -> Result<(R, Result<()>)>,
) -> Result<()> {
    if let [flight] = flights {
        let (report, verdict) = work(flight)?;
        if json {
            terminal::print_json(&report)?;
        }
        return verdict;
    }
    let (reports, end) = all(flights, json, work)?;
    if json {
        terminal::print_json(&Several { flights: reports })?;
    }
    end
}

/// Calls `work` for each of several flights; returns what came of each, and the error to end with.
///
/// # Errors
/// Returns an error after Ctrl-C.
pub(super) fn all<R>(
    flights: &[PathBuf],
    json: bool,
    mut work: impl FnMut(&Path) -> Result<(R, Result<()>)>,
) -> Result<(Vec<Outcome<R>>, Result<()>)> {
    let mut reports = Vec::new();
    let mut worst: Option<Kind> = None;
    let mut failed = 0;
    for flight in flights {
        if !json {
            terminal::print(&format!("{}:", flight.display()));
        }
        let (report, verdict) = match work(flight) {
            Ok((report, verdict)) => (Some(report), verdict),
            Err(problem) => (None, Err(problem)),
        };
        let problem = verdict.err();
        let error = problem.as_ref().map(terminal::Told::of);
        let flight = flight.clone();
        reports.push(Outcome {
            flight,
            report,
            error,
        });
        let Some(problem) = problem else { continue };
        if problem.kind == Kind::Interrupted {
            return Err(problem);
        }
        failed += 1;
        worst = worst
            .into_iter()
            .chain([problem.kind])
            .max_by_key(|kind| rank(*kind));
        if !json {
            terminal::print_problem(problem, false);
        }
    }
    let message = || format!("{failed} of {} flights have problems", flights.len());
    let end = worst.map_or(Ok(()), |kind| {
        Err(Problem {
            kind,
            ..Problem::bad_input(message())
        })
    });
    Ok((reports, end))
}

/// Severity of a problem: failing to do the work is worse than a negative answer.
const fn rank(kind: Kind) -> u8 {
    match kind {
        Kind::Doubt => 0,
        Kind::Disagreement => 1,
        Kind::BadInput => 2,
        Kind::System => 3,
        Kind::Interrupted | Kind::Internal => 4,
    }
}
