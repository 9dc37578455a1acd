//! Real flights bundled with the program; see `verbs/data/acrobatics/README.md` for their origin and licence.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::write_file;

/// Files of the bundled flights.
macro_rules! files {
    ($folder:literal $($name:literal)*) => {
        [$(($name, include_bytes!(concat!("../../data/", $folder, "/", $name)).as_slice())),*]
    };
}

const FILES: [(&str, &[u8]); 10] = files![
    "acrobatics"
    "LICENSE" "README.md"
    "flight-1.mvnx.gz" "flight-1.toml" "segments-1.json" "subject-1.toml"
    "flight-3.mvnx.gz" "flight-3.toml" "segments-3.json" "subject-3.toml"
];

/// Jumps of the CMU library; see `verbs/data/cmu/README.md` for their origin.
const CMU_FILES: [(&str, &[u8]); 3] = files!["cmu" "README.md" "01.asf" "01_01.amc.gz"];

/// The people in the bundled flights and jumps.
const TABLE: &str = "[[captures]]\nsource = \"Montreal\"\nperson = \"A\"\nfile = \"flight-1.toml\"\n\
    [[captures]]\nsource = \"Montreal\"\nperson = \"A\"\nfile = \"flight-3.toml\"\n\
    [[captures]]\nsource = \"CMU\"\nperson = \"01\"\nfile = \"cmu/01_01.amc.gz\"\n";

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

/// Writes the jumps of other sources next to the flights, and returns the path of the table of them all.
///
/// # Errors
/// Returns an error if the folder cannot be written to.
pub fn write_table(folder: &Path) -> Result<PathBuf> {
    let cmu = folder.join("cmu");
    std::fs::create_dir_all(&cmu).map_err(|error| Problem::system("create", &cmu, error))?;
    for (name, bytes) in CMU_FILES {
        write_file(&cmu.join(name), bytes)?;
    }
    let table = folder.join("captures.toml");
    write_file(&table, TABLE.as_bytes())?;
    Ok(table)
}

/// Creates a folder that lasts for one run.
///
/// # Errors
/// Returns an error if it cannot be created.
pub fn temporary() -> Result<tempfile::TempDir> {
    tempfile::tempdir().map_err(|error| Problem::system("create", &std::env::temp_dir(), error))
}
