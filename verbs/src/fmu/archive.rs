//! A unit's archive.

use std::io::Write;
use std::path::Path;

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::files::AtomicFile;

/// Writes the entries as an archive.
pub(super) fn archive(
    path: &Path,
    file: AtomicFile,
    entries: &[(String, Vec<u8>)],
) -> Result<AtomicFile> {
    let refused = |error: zip::result::ZipError| {
        Problem::refused("cannot write the unit")
            .in_file(path)
            .caused_by(error)
    };
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .unix_permissions(0o755);
    let mut archive = ZipWriter::new(file);
    for (name, content) in entries {
        archive.start_file(name, options).map_err(refused)?;
        archive
            .write_all(content)
            .map_err(|error| Problem::system("write", path, error))?;
    }
    archive.finish().map_err(refused)
}
