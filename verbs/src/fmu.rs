//! `bodyflight fmu`: a skydiver as a co-simulation unit of FMI 2.0 or 3.0, for Simulink, OpenModelica and others.
//!
//! A unit is an archive with `modelDescription.xml`, the library of the crate bodyflight-fmu for this platform, and the
//! person and the air as resources, which the library reads when it is loaded.

#[cfg_attr(not(feature = "fmu"), path = "fmu/without_archive.rs")]
mod archive;

use std::path::{Path, PathBuf};

use serde::Serialize;
use sha2::{Digest, Sha256};

use self::archive::archive;
use crate::flight_text::{SUBJECT_FILE, flight_text};
pub use bodyflight_fmi::standard::Standard;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::subject::SEGMENTS_FILE;

/// Name of the library in the unit, without its extension; FMI calls it the model's identifier.
const IDENTIFIER: &str = "bodyflight";
/// Environment variable with the library's path, which takes precedence over a library beside the program.
const LIBRARY_VARIABLE: &str = "BODYFLIGHT_FMU";

/// Description of the written unit.
#[derive(Debug, Clone, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Report {
    /// The unit's file.
    pub file: PathBuf,
    /// The version of FMI.
    pub standard: &'static str,
    /// The unit's instantiation token.
    pub token: String,
    /// The platform of the library, in FMI's terms.
    pub platform: String,
    /// Number of inputs, parameters and outputs.
    pub variables: usize,
    /// Size of the file (bytes).
    pub bytes: u64,
}

/// Finds the library of units: as given, from the environment, or beside the program.
///
/// # Errors
/// Returns an error if there is none.
pub fn library(given: Option<&Path>) -> Result<PathBuf> {
    if let Some(path) = given {
        return Ok(path.to_path_buf());
    }
    if let Some(path) = std::env::var_os(LIBRARY_VARIABLE) {
        return Ok(PathBuf::from(path));
    }
    let name = format!(
        "{}bodyflight_fmu{}",
        std::env::consts::DLL_PREFIX,
        std::env::consts::DLL_SUFFIX
    );
    let beside = std::env::current_exe().map(|program| program.with_file_name(&name));
    beside.ok().filter(|path| path.is_file()).ok_or_else(|| {
        Problem::bad_input(format!("the unit's library, {name}, was not found beside the program"))
            .help("released wheels contain it, an installation from source does not: build it with cargo build --release --package bodyflight-fmu, and pass its path with --library")
    })
}

/// The resource files that the library reads: the flight without its recording.
fn resources(flight: &Flight) -> Result<Vec<(&'static str, String)>> {
    let mut files = vec![
        ("flight.toml", flight_text(flight, "none.mvnx")),
        (SUBJECT_FILE, flight.subject.to_toml()?),
    ];
    if let Some(table) = flight.subject.segments_json() {
        files.push((SEGMENTS_FILE, table.to_owned()));
    }
    Ok(files)
}

/// Writes a unit of a version of FMI with a flight's person and air, and the given library.
///
/// # Errors
/// Returns an error if the library cannot be read or the file cannot be written; no partial file is left.
pub fn write(flight: &Flight, standard: Standard, library: &Path, path: &Path) -> Result<Report> {
    let binary = std::fs::read(library).map_err(|error| Problem::system("read", library, error))?;
    let resources = resources(flight)?;
    let mut hasher = Sha256::new();
    hasher.update(&binary);
    for (_, text) in &resources {
        hasher.update(text);
    }
    let digest = hasher.finalize();
    let token: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    let platform = standard.platform(std::env::consts::ARCH, std::env::consts::OS);
    let end = std::env::consts::DLL_SUFFIX;
    let mut entries = vec![(format!("binaries/{platform}/{IDENTIFIER}{end}"), binary)];
    let resource = |(name, text): (&str, String)| (format!("resources/{name}"), text.into_bytes());
    entries.extend(resources.into_iter().map(resource));
    let variables = archive(path, flight, standard, [IDENTIFIER, &token], &entries)?;
    let size = std::fs::metadata(path).map_err(|error| Problem::system("read", path, error))?;
    Ok(Report {
        file: path.to_path_buf(),
        standard: standard.name(),
        token,
        platform,
        variables,
        bytes: size.len(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_replay::flight::DensityChoice;

    #[test]
    fn a_unit_has_the_person_and_the_air_of_its_flight() {
        let flight = Flight {
            air_velocity: [1.0, -2.5, 0.0],
            density: DensityChoice::FirstFrameAltitude(1200.0),
            ..Flight::bare(Path::new("none.mvnx"))
        };
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in resources(&flight).unwrap() {
            std::fs::write(folder.path().join(name), text).unwrap();
        }
        let again = Flight::read(folder.path()).unwrap();
        assert_eq!(again.dynamics(3.0), flight.dynamics(3.0));
    }

    #[test]
    fn a_missing_library_is_reported() {
        let problem = library(None).unwrap_err();
        assert!(problem.help.unwrap().contains("--library"));
    }
}
