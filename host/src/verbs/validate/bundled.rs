//! Real flights bundled with the program; see `host/data/acrobatics/README.md` for their origin and licence.

use std::path::{Path, PathBuf};

use crate::diagnostic::{Problem, Result};
use crate::output::files::write_file;

/// Files of the bundled flights.
macro_rules! files {
    ($($name:literal)*) => {
        [$(($name, include_bytes!(concat!("../../../data/acrobatics/", $name)).as_slice())),*]
    };
}

const FILES: [(&str, &[u8]); 10] = files![
    "LICENSE" "README.md"
    "flight-1.mvnx.gz" "flight-1.toml" "segments-1.json" "subject-1.toml"
    "flight-3.mvnx.gz" "flight-3.toml" "segments-3.json" "subject-3.toml"
];

/// Writes the bundled flights, with licence and origin, into an existing folder, and returns the paths of the flights.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn write(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut flights = Vec::new();
    for (name, bytes) in FILES {
        let path = folder.join(name);
        write_file(&path, bytes)?;
        if name.starts_with("flight") && name.ends_with(".toml") {
            flights.push(path);
        }
    }
    Ok(flights)
}

/// Creates a folder that lasts for one run.
///
/// # Errors
/// Returns an error if it cannot be created.
pub fn temporary() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|error| Problem::system("create", &std::env::temp_dir(), error))
}
