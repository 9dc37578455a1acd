//! Several flights in one call: one after another, each whatever becomes of the others.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use bodyflight::diagnostic::{Kind, Problem, Result};
use schemars::JsonSchema;
use serde::Serialize;

use super::terminal;

/// What stands for the flight's name in the names of outputs.
const NAME: &str = "{}";

/// A name for people: that of the folder for the usual `flight.toml`, else that of the file.
pub(super) fn name_of(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or(path.as_os_str());
    let folder = path.parent().and_then(Path::file_name);
    match folder {
        Some(folder) if stem == "flight" => folder.to_string_lossy().into_owned(),
        _ => stem.to_string_lossy().into_owned(),
    }
}

/// The file that a flight is read from: that of a folder, or the one that is named.
pub(super) fn file_of(flight: &Path) -> PathBuf {
    if flight.is_dir() {
        flight.join("flight.toml")
    } else {
        flight.to_path_buf()
    }
}

/// The name of a flight, also of one that is called by where it is, such as `.`.
fn name(flight: &Path) -> String {
    name_of(
        &flight
            .canonicalize()
            .unwrap_or_else(|_| flight.to_path_buf()),
    )
}

/// An output of one of `flights`: of several, each has one of its own.
///
/// # Errors
/// Returns an error if several flights would write one file.
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
            .help("{} stands for the name of the flight, as in {}.csv"));
        }
        let mut named = BTreeMap::new();
        for other in flights {
            if let Some(before) = named.insert(name(other), other) {
                return Err(Problem::bad_input(format!(
                    "this flight and {} have one name, and would write one file",
                    before.display()
                ))
                .in_file(other)
                .help("call the program once for each"));
            }
        }
    }
    Ok(Some(PathBuf::from(text.replace(NAME, &name(flight)))))
}

/// What became of several flights, in their order.
#[derive(JsonSchema, Serialize)]
pub(super) struct Several<R> {
    flights: Vec<Outcome<R>>,
}

/// What became of one of several flights.
#[derive(JsonSchema, Serialize)]
struct Outcome<R> {
    flight: PathBuf,
    /// Result; null where there is none.
    report: Option<R>,
    /// The problem, if there was one.
    error: Option<terminal::Told>,
}

/// Works on each flight. `work` returns what is printed as JSON; where JSON is not asked for it has printed by itself.
///
/// # Errors
/// Returns the problem of the flight, or, of several, an error after all were worked on if one had a problem. Ctrl-C ends at
/// once.
pub(super) fn each<R: Serialize + JsonSchema>(
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
    if json {
        terminal::print_json(&Several { flights: reports })?;
    }
    let Some(kind) = worst else { return Ok(()) };
    let message = format!("{failed} of {} flights have problems", flights.len());
    Err(Problem {
        kind,
        ..Problem::bad_input(message)
    })
}

/// How bad a problem is: a call that could not do its work is worse than an answer that is no.
const fn rank(kind: Kind) -> u8 {
    match kind {
        Kind::Doubt => 0,
        Kind::Disagreement => 1,
        Kind::BadInput => 2,
        Kind::System => 3,
        Kind::Interrupted | Kind::Internal => 4,
    }
}
