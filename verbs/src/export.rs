//! `bodyflight export`: a flight and its simulation at the full rate, as files for other programs.

mod entries;
mod format;
#[cfg(feature = "export")]
mod packed;
#[cfg(not(feature = "export"))]
#[path = "export/without_packed.rs"]
mod packed;

use std::path::{Path, PathBuf};

use serde::Serialize;

pub use self::format::Format;

use self::entries::{Entry, Seen, entries};
use bodyflight_core::body::mass_properties::PostureRate;
use bodyflight_estimation::motion::Method;
use bodyflight_estimation::report::Point;
use bodyflight_estimation::request;
use bodyflight_export::about::{About, PROGRAM};
use bodyflight_export::columns::csv::CsvTable;
use bodyflight_export::columns::quantity::{Quantity, Sink};
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::Options;
use bodyflight_replay::Precision;
use bodyflight_replay::flight::Flight;
use bodyflight_replay::frames::Frames;
use bodyflight_replay::preset_file::{AUTO, Tuning};
use bodyflight_replay::steps::{Replay, Step};

use crate::flight_text::flight_text;

/// Description of the written file.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The file.
    pub file: PathBuf,
    /// Its kind.
    pub format: Format,
    /// Number of frames, including the first.
    pub frames: u64,
    /// Numbers per frame.
    pub columns: usize,
    /// Length of the flight (s).
    pub duration_s: f64,
    /// Size of the file (bytes).
    pub bytes: u64,
    /// Why the recording, or the estimates in the file, should not be trusted.
    pub doubt: Option<String>,
}

/// Simulates a flight beside its recording and writes every frame, with the motion filter's results if `estimates` is
/// given. `arguments` are those of the run, for files that keep them.
///
/// # Errors
/// Returns an error if a file is unusable, the simulation diverges, or the file cannot be written; no partial file is
/// left.
pub fn export(
    flight: &Flight,
    options: Options,
    (path, format): (&Path, Format),
    estimates: Option<Method>,
    arguments: &[String],
    progress: &mut dyn FnMut(f64),
) -> Result<Report> {
    let entries = entries(estimates.is_some());
    let mut replay = Replay::open(flight, options, Precision::Double)?;
    let about = about(flight, replay.recording(), arguments)?;
    let mut sink = sink(flight, path, format, &entries, &about)?;
    let estimation = estimates
        .map(|method| {
            let request = request::Request {
                tuning: Tuning::find(AUTO)?,
                method,
                filter: None,
            };
            request.run(flight, options, Precision::Double, progress)
        })
        .transpose()?;
    let points = estimation.as_ref().map(|found| found.points.as_slice());
    let (dynamics, start) = (replay.model().dynamics, *replay.start());
    let mut points = points.unwrap_or_default();
    let mut row = Vec::new();
    let (mut frames, mut end) = (0_u64, start.time);
    let mut steps = std::iter::once(Ok(start)).chain(replay.by_ref());
    let (mut before, mut now): (Option<Step>, Option<Step>) = (None, steps.next().transpose()?);
    while let Some(step) = now {
        let next = steps.next().transpose()?;
        let rate = joint_rates(&before.unwrap_or(step), &next.unwrap_or(step));
        // The latest estimate up to now applies.
        while let [_, next, ..] = points
            && next.time <= step.time
        {
            points = &points[1..];
        }
        let known = points
            .first()
            .filter(|point: &&Point| point.time <= step.time);
        let seen = Seen::of(&dynamics, &step, &rate, known);
        row.clear();
        for entry in &entries {
            entry.take(&seen, &mut row);
        }
        sink.write(&row)?;
        frames += 1;
        end = step.time;
        if frames.is_multiple_of(1024) {
            progress(step.time);
            interrupt::check()?;
        }
        (before, now) = (now, next);
    }
    sink.finish()?;
    let size = std::fs::metadata(path).map_err(|error| Problem::system("read", path, error))?;
    Ok(Report {
        file: path.to_path_buf(),
        format,
        frames,
        columns: row.len(),
        duration_s: end - start.time,
        bytes: size.len(),
        doubt: replay
            .doubt()
            .or_else(|| estimation.and_then(|found| found.report.doubt)),
    })
}

/// Joint rates between two frames; none if they are the same.
fn joint_rates(before: &Step, after: &Step) -> PostureRate<f64> {
    let duration = after.time - before.time;
    if duration > 0.0 {
        PostureRate::between(&before.posture, &after.posture, duration)
    } else {
        PostureRate::zero()
    }
}

/// What the file says about itself.
fn about(flight: &Flight, recording: &Frames, arguments: &[String]) -> Result<About> {
    let name = flight.recording.display().to_string();
    let arguments = serde_json::to_string(arguments)
        .map_err(|error| Problem::internal("cannot write the arguments").caused_by(error))?;
    let header = recording.header();
    let facts = [
        ("program", Some(PROGRAM.to_owned())),
        ("arguments", Some(arguments)),
        ("flight", Some(flight_text(flight, &name))),
        ("subject", Some(flight.subject.to_toml()?)),
        (
            "segments",
            flight.subject.segments_json().map(str::to_owned),
        ),
        ("recorded", header.recorded.clone()),
        ("subject_label", header.subject_label.clone()),
    ];
    let known = facts
        .into_iter()
        .filter_map(|(name, fact)| Some((name.to_owned(), fact?)));
    Ok(About {
        facts: known.collect(),
        began: recording.began(),
    })
}

/// The file that takes the rows.
fn sink(
    flight: &Flight,
    path: &Path,
    format: Format,
    entries: &[Entry],
    about: &About,
) -> Result<Box<dyn Sink>> {
    let quantities: Vec<Quantity> = entries.iter().map(|entry| entry.quantity.clone()).collect();
    match format {
        Format::Csv => Ok(Box::new(CsvTable::create(path, &quantities)?)),
        packed => packed::sink(&flight.subject.body(), (path, packed), &quantities, about),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use bodyflight_export::columns::quantity::Of;

    #[test]
    fn every_column_and_array_has_a_unique_name() {
        let entries = entries(true);
        let names = |name: &dyn Fn(&Quantity) -> Vec<String>| {
            let all: Vec<String> = entries.iter().flat_map(|e| name(&e.quantity)).collect();
            let different: BTreeSet<&String> = all.iter().collect();
            assert_eq!(different.len(), all.len(), "{all:?}");
            all.len()
        };
        let columns = names(&Quantity::columns);
        let widths: usize = entries.iter().map(|entry| entry.quantity.width()).sum();
        assert_eq!(columns, widths);
        assert_eq!(names(&|quantity| vec![quantity.array()]), entries.len());
        let of_segments = entries.iter().filter(|e| e.quantity.of == Of::Segments);
        assert_eq!(of_segments.count(), 10);
    }
}
