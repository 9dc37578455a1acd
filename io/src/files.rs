//! Output files and folders that are complete or absent: they get their name at the end, so an interrupted command leaves
//! what was there untouched.

use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use crate::destination::{destination, folder_of};
use crate::diagnostic::{Problem, Result};
use crate::interrupt::Unfinished;
use crate::scratch::{self, Scratch, ScratchFolder};

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

/// A new folder that appears under its name only once all its files are written.
pub struct AtomicFolder {
    making: ScratchFolder,
    path: PathBuf,
    _unfinished: Unfinished,
}

impl AtomicFolder {
    /// Starts the folder beside its later place; the folders above it are created if they do not exist.
    ///
    /// # Errors
    /// Returns an error if the path exists, or if the folder above it cannot be created or written to.
    pub fn create(path: &Path) -> Result<Self> {
        is_new(path)?;
        let above = folder_of(path);
        let refused = |error: io::Error| Problem::system("create", path, error);
        std::fs::create_dir_all(above).map_err(refused)?;
        let making = ScratchFolder::create(above).map_err(refused)?;
        Ok(Self {
            _unfinished: Unfinished::new(making.folder.path()),
            making,
            path: path.to_path_buf(),
        })
    }

    /// Where the files are to be written until the folder is finished.
    pub fn path(&self) -> &Path {
        self.making.folder.path()
    }

    /// Moves the folder to its name.
    ///
    /// # Errors
    /// Returns an error if the path exists by now or the system refuses; no folder is left then.
    pub fn finish(self) -> Result<()> {
        is_new(&self.path)?;
        let refused = |error: io::Error| Problem::system("write", &self.path, error);
        // Temporary folders are private; finished ones get the usual permissions.
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let public = std::fs::Permissions::from_mode(0o755);
            std::fs::set_permissions(self.path(), public).map_err(refused)?;
        }
        std::fs::rename(self.path(), &self.path).map_err(refused)?;
        // It is no longer at the place from which it would be removed.
        let _ = self.making.folder.keep();
        Ok(())
    }
}

/// Removes what processes that were killed left unfinished in a folder. Creating a file or folder there does so too.
pub fn sweep(folder: &Path) {
    scratch::sweep(folder);
}

/// Checks that nothing has this name yet.
fn is_new(path: &Path) -> Result<()> {
    match path.symlink_metadata() {
        Ok(_) => Err(Problem::bad_input("this exists already")
            .in_file(path)
            .help("give another name to the output")),
        Err(_) => Ok(()),
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
    fn a_folder_appears_with_all_its_files_or_not_at_all() {
        let place = tempfile::tempdir().unwrap();
        let above = place.path().join("flights");
        let path = above.join("flown-0");
        let begin = || {
            let folder = AtomicFolder::create(&path).unwrap();
            write_file(&folder.path().join("flight.toml"), b"half").unwrap();
            folder
        };
        drop(begin());
        assert_eq!(std::fs::read_dir(&above).unwrap().count(), 0);
        let (first, second) = (begin(), begin());
        assert!(!path.exists());
        first.finish().unwrap();
        assert_eq!(std::fs::read(path.join("flight.toml")).unwrap(), b"half");
        // What exists is never replaced, and what was not finished leaves no trace.
        assert!(second.finish().is_err());
        assert!(AtomicFolder::create(&path).is_err());
        assert_eq!(std::fs::read_dir(&above).unwrap().count(), 1);
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
