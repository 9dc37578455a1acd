//! `bodyflight export`: a flight and its simulation at the full rate, as files for other programs.

mod entries;

use std::path::{Path, PathBuf};

use bodyflight_core::Segment;
use bodyflight_viewer::frame::half_extents;
use schemars::JsonSchema;
use serde::Serialize;

use self::entries::{Entry, Seen, entries};
use crate::diagnostic::{Problem, Result};
use crate::formats::columns::csv::CsvTable;
use crate::formats::columns::npz::NpzArchive;
use crate::formats::columns::parquet::ParquetTable;
use crate::formats::columns::quantity::{Quantity, Sink};
use crate::formats::flight::Flight;
use crate::formats::foxglove::recording::{McapRecording, Solid};
use crate::formats::preset_file::{AUTO, Tuning};
use crate::formats::recording::Options;
use crate::interrupt;
use crate::replay::steps::{Replay, Step};
use crate::verbs::estimate::motion::Method;
use crate::verbs::estimate::report::Point;
use crate::verbs::estimate::request;

/// A kind of file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, JsonSchema, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Format {
    /// Compressed columns.
    Parquet,
    /// Columns as text.
    Csv,
    /// A moving body, for Foxglove.
    Mcap,
    /// Arrays, for NumPy.
    Npz,
}

impl Format {
    /// All kinds.
    pub const ALL: [Self; 4] = [Self::Parquet, Self::Csv, Self::Mcap, Self::Npz];

    /// Name, which is also the file extension.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Parquet => "parquet",
            Self::Csv => "csv",
            Self::Mcap => "mcap",
            Self::Npz => "npz",
        }
    }

    /// The kind with that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// The kind of a file according to its extension.
    ///
    /// # Errors
    /// Returns an error if the extension is unknown.
    pub fn of(path: &Path) -> Result<Self> {
        let end = path.extension().unwrap_or_default().to_string_lossy();
        Self::from_name(&end.to_lowercase()).ok_or_else(|| {
            Problem::bad_input("expected a name that ends in .parquet, .csv, .mcap or .npz")
                .in_file(path)
                .help("or give the kind of file with --format")
        })
    }
}

/// Description of the written file.
#[derive(Debug, Clone, JsonSchema, Serialize)]
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
    /// Why the estimates in it should not be trusted.
    pub doubt: Option<String>,
}

/// Simulates a flight beside its recording and writes every frame, with the motion filter's results if `estimates` is
/// given.
///
/// # Errors
/// Returns an error if a file is unusable, the simulation diverges, or the file cannot be written; no partial file is
/// left.
pub fn export(
    flight: &Flight,
    options: Options,
    (path, format): (&Path, Format),
    estimates: Option<Method>,
    mut progress: impl FnMut(f64),
) -> Result<Report> {
    let estimation = estimates
        .map(|method| {
            let request = request::Request {
                tuning: Tuning::find(AUTO)?,
                method,
                filter: None,
            };
            request.run::<f64>(flight, options, &mut progress)
        })
        .transpose()?;
    let points = estimation.as_ref().map(|found| found.points.as_slice());
    let entries = entries(points.is_some());
    let mut sink = sink(flight, path, format, &entries)?;
    let replay = Replay::<f64, _>::open(flight, options)?;
    let (dynamics, start) = (replay.model().dynamics, *replay.start());
    let mut points = points.unwrap_or_default();
    let mut row = Vec::new();
    let (mut frames, mut end) = (0_u64, start.time);
    for step in std::iter::once(Ok(start)).chain(replay) {
        let step: Step = step?;
        // The latest estimate up to now applies.
        while let [_, next, ..] = points
            && next.time <= step.time
        {
            points = &points[1..];
        }
        let known = points
            .first()
            .filter(|point: &&Point| point.time <= step.time);
        let seen = Seen::of(&dynamics, &step, known);
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
        doubt: estimation.and_then(|found| found.report.doubt),
    })
}

/// The file that takes the rows.
fn sink(flight: &Flight, path: &Path, format: Format, entries: &[Entry]) -> Result<Box<dyn Sink>> {
    let quantities: Vec<Quantity> = entries.iter().map(|entry| entry.quantity.clone()).collect();
    Ok(match format {
        Format::Csv => Box::new(CsvTable::create(path, &quantities)?),
        Format::Parquet => Box::new(ParquetTable::create(path, &quantities)?),
        Format::Npz => Box::new(NpzArchive::create(path, quantities)?),
        Format::Mcap => {
            let body = flight.subject.body();
            let solid = |segment: Segment| Solid {
                half_extents: half_extents(&body.segments[segment].area).into(),
                middle: body.segments[segment].cg.into(),
            };
            let solids = Segment::ALL.map(solid).to_vec();
            Box::new(McapRecording::create(path, quantities, solids)?)
        }
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::formats::columns::quantity::Of;

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

    #[test]
    fn the_kind_of_a_file_is_detected() {
        assert_eq!(Format::of(Path::new("a/run.MCAP")).unwrap(), Format::Mcap);
        for wrong in ["run", "run.xlsx", ".csv"] {
            assert!(Format::of(Path::new(wrong)).is_err(), "{wrong}");
        }
    }
}
