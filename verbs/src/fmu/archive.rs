//! A unit's archive.

use std::io::Write;
use std::path::Path;

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use bodyflight_fmi::description::description;
use bodyflight_fmi::standard::Standard;
use bodyflight_fmi::variables::variables;
use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;
use bodyflight_replay::flight::Flight;

/// Writes an archive with the description of a unit of this identifier and token, and the other entries; returns the number
/// of its variables.
///
/// # Errors
/// Returns an error if the file cannot be written; no partial file is left.
pub(super) fn archive(
    path: &Path,
    flight: &Flight,
    standard: Standard,
    [identifier, token]: [&str; 2],
    entries: &[(String, Vec<u8>)],
) -> Result<usize> {
    let variables = variables(flight);
    let description = description(standard, identifier, token, &variables);
    let refused = |error: zip::result::ZipError| {
        Problem::refused("cannot write the unit")
            .in_file(path)
            .caused_by(error)
    };
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .unix_permissions(0o755);
    let mut archive = ZipWriter::new(AtomicFile::create(path)?);
    let description = ("modelDescription.xml".to_owned(), description.into_bytes());
    for (name, content) in std::iter::once(&description).chain(entries) {
        archive.start_file(name, options).map_err(refused)?;
        archive
            .write_all(content)
            .map_err(|error| Problem::system("write", path, error))?;
    }
    archive.finish().map_err(refused)?.finish()?;
    Ok(variables.len())
}
