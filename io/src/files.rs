//! Output files that are complete or absent: they get their name at the end, so an interrupted command leaves the
//! previous file untouched.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::destination::{destination, folder_of};
use crate::diagnostic::{Problem, Result};
use crate::scratch::Scratch;

/// A file that appears under its name only once it is finished.
pub struct AtomicFile {
    file: BufWriter<Scratch>,
    path: PathBuf,
}

impl AtomicFile {
    /// Starts the file in the folder of `path`.
    ///
    /// # Errors
    /// Returns an error if the folder does not exist or cannot be written to, or for the reasons given at
    /// [`destination`].
    pub fn create(path: &Path) -> Result<Self> {
        let file = Scratch::create(folder_of(&destination(path)?))
            .map_err(|error| Problem::system("create", path, error))?;
        Ok(Self {
            file: BufWriter::new(file),
            path: path.to_path_buf(),
        })
    }

    /// Moves the file to its name, replacing any existing file that this process does not read.
    ///
    /// # Errors
    /// Returns an error if the system refuses, or for the reasons given at [`destination`]; no file is left then.
    pub fn finish(self) -> Result<()> {
        let place = destination(&self.path)?;
        let refused = |error: io::Error| Problem::system("write", &self.path, error);
        let file = self
            .file
            .into_inner()
            .map_err(|error| refused(error.into_error()))?;
        file.finish(&place, folder_of(&place)).map_err(refused)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }
    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.file.seek(to)
    }
}

/// Formats a number as in tables.
pub fn number(value: f64) -> String {
    format!("{value:.6}")
}

/// A CSV table of numbers with six decimals, complete or absent like every output file.
pub struct CsvFile {
    writer: csv::Writer<AtomicFile>,
    path: PathBuf,
}

impl CsvFile {
    /// Starts the file with the column names.
    ///
    /// # Errors
    /// Returns an error if the folder cannot be written to.
    pub fn create(path: &Path, columns: &[impl AsRef<[u8]>]) -> Result<Self> {
        let writer = csv::Writer::from_writer(AtomicFile::create(path)?);
        let mut file = Self {
            writer,
            path: path.to_path_buf(),
        };
        let written = file.writer.write_record(columns);
        file.check(written)?;
        Ok(file)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// Returns an error if the system refuses, or if the row is longer or shorter than the others.
    pub fn write(&mut self, values: impl IntoIterator<Item = f64>) -> Result<()> {
        self.write_fields(values.into_iter().map(number))
    }

    /// Adds a row of texts; see [`number`] for formatting numbers.
    ///
    /// # Errors
    /// Returns an error if the system refuses, or if the row is longer or shorter than the others.
    pub fn write_fields(&mut self, fields: impl IntoIterator<Item = String>) -> Result<()> {
        let written = self.writer.write_record(fields);
        self.check(written)
    }

    /// Moves the file to its name.
    ///
    /// # Errors
    /// Returns an error if the system refuses; no file is left then.
    pub fn finish(self) -> Result<()> {
        match self.writer.into_inner() {
            Ok(file) => file.finish(),
            Err(error) => Err(Problem::system("write", &self.path, error.into_error())),
        }
    }

    fn check(&self, written: csv::Result<()>) -> Result<()> {
        // Rows are as long as the header, so only the disk can fail here.
        written.map_err(|error| Problem::system("write", &self.path, error.into()))
    }
}

/// Writes a whole file at once.
///
/// # Errors
/// Returns an error if the system refuses; no file is left then.
pub fn write_file(path: &Path, content: &[u8]) -> Result<()> {
    let mut file = AtomicFile::create(path)?;
    file.write_all(content)
        .map_err(|error| Problem::system("write", path, error))?;
    file.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unfinished_file_leaves_no_trace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.csv");
        write_file(&path, b"old").unwrap();
        let mut file = AtomicFile::create(&path).unwrap();
        file.write_all(b"half").unwrap();
        drop(file);
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let problem = write_file(Path::new("/nowhere/run.csv"), b"").unwrap_err();
        assert_eq!(problem.kind, crate::diagnostic::Kind::System);
        assert!(problem.to_string().contains("/nowhere/run.csv"));
        let folder = tempfile::tempdir().unwrap();
        assert!(AtomicFile::create(folder.path()).is_err());
    }
}
