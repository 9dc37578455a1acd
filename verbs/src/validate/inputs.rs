//! What a validation is made with: the user's flights, tracks and tables of captures, or the bundled ones.

use std::path::PathBuf;

use bodyflight_io::diagnostic::Result;
use bodyflight_io::interrupt::Unfinished;
use bodyflight_replay::recorded::Recorded;
use bodyflight_tracks::folder;
use tempfile::TempDir;

use super::captures::{is_table, judged};
use super::{Report, bundled, read, validate};
use crate::fall::is_of_logger;

/// The inputs of a validation.
pub struct Inputs {
    /// Flights with their names.
    pub flights: Vec<(String, Recorded)>,
    tracks: Vec<PathBuf>,
    tables: Vec<PathBuf>,
    /// Where the bundled files are, as long as they are needed.
    _bundled: (TempDir, Unfinished),
}

impl Inputs {
    /// Reads flights, and finds the tracks in folders of loggers. Without flights and tables the bundled flights are
    /// read, and without anything the bundled captures too.
    ///
    /// # Errors
    /// Returns an error if a flight is unusable, or a folder has no track.
    pub fn read(paths: &[PathBuf]) -> Result<Self> {
        let folder = bundled::temporary()?;
        let unfinished = Unfinished::new(folder.path());
        let (mut tables, others): (Vec<_>, Vec<_>) =
            paths.iter().cloned().partition(|path| is_table(path));
        let (of_loggers, mut flights): (Vec<_>, Vec<_>) =
            others.into_iter().partition(|path| is_of_logger(path));
        if flights.is_empty() && tables.is_empty() {
            flights = bundled::write(folder.path())?;
        }
        if paths.is_empty() {
            tables.push(bundled::write_table(folder.path())?);
        }
        let tracks = of_loggers.iter().map(|path| folder::tracks(path));
        let tracks = tracks.collect::<Result<Vec<_>>>()?.concat();
        let flights = flights.iter().map(|path| {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            Ok((name.into_owned(), read(path)?))
        });
        Ok(Self {
            flights: flights.collect::<Result<_>>()?,
            tracks,
            tables,
            _bundled: (folder, unfinished),
        })
    }

    /// Compares the model with all of them.
    ///
    /// # Errors
    /// Returns an error if Ctrl-C was pressed, or a table of captures cannot be used.
    pub fn validate(&self) -> Result<Report> {
        let mut report = validate(&self.flights, &self.tracks)?;
        report.captures = judged(&self.tables)?;
        Ok(report)
    }
}
