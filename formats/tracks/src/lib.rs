//! Reads the tracks of skydivers' loggers.
//!
//! The format is recognised by the content; one file of this crate reads one format, and `points.rs` turns its fixes into
//! samples. Text may be in UTF-8 or UTF-16, and CSV may have semicolons or tabs and decimal commas.

mod fit;
pub mod flysight;
pub mod folder;
mod gpx;
mod igc;
mod kml;
mod nmea;
mod plain;
mod points;
mod tes;
mod text;
mod track;
mod ubx;
mod xml;

use std::path::Path;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::file_kind::FileKind;
use bodyflight_io::input;
use bodyflight_io::text::with_commas;

pub use points::date;
pub use track::{InertialSample, Track};

/// Reads a track.
///
/// # Errors
/// Returns an error if the file cannot be read, has no known format, or has fewer than two usable rows.
pub fn read(path: &Path) -> Result<Track> {
    parse(&input::bytes(path)?, path)
}

/// Like [`read`], for bytes already read from `path`.
///
/// # Errors
/// Same as [`read`].
pub fn parse(bytes: &[u8], path: &Path) -> Result<Track> {
    let track = recognised(bytes, path).map_err(|problem| problem.in_file(path))?;
    if track.samples.len() < 2 {
        return Err(Problem::bad_input(format!(
            "expected a track of at least two rows, found {} in this {} file",
            track.samples.len(),
            track.format
        ))
        .in_file(path)
        .help("give the recording of a whole jump, as the logger wrote it"));
    }
    Ok(track)
}

fn recognised(bytes: &[u8], path: &Path) -> Result<Track> {
    if fit::is_fit(bytes) {
        return fit::read(bytes);
    }
    if ubx::is_ubx(bytes) {
        return ubx::read(bytes);
    }
    if bytes.starts_with(b"PK\x03\x04") {
        return Err(
            Problem::bad_input("this is a ZIP archive (or a KMZ file), not a track")
                .help("unpack it, and give the file inside"),
        );
    }
    let text = text::plain(bytes);
    let found = FileKind::of_head(&text).filter(|kind| !matches!(kind, FileKind::Text));
    if let Some(problem) = FileKind::Track.mistaken(found) {
        return Err(problem);
    }
    if text.starts_with(b"<") {
        return in_xml(&text);
    }
    if igc::is_igc(&text) {
        return igc::read(&text);
    }
    if nmea::is_nmea(&text) {
        return nmea::read(&text);
    }
    if tes::is_tes(bytes) {
        return tes::read(bytes);
    }
    let text = with_commas(&text);
    if flysight::is_flysight_text(&text) {
        return flysight::track(&text, path);
    }
    // Text of one column is no table; formats that look so were read above.
    if let Some(problem) = FileKind::Track.mistaken(FileKind::of_head(&text)) {
        return Err(problem);
    }
    plain::read(&text)
}

/// Number of bytes at the start that are searched for the root element.
const HEAD: usize = 2048;

/// Reads a track in XML.
fn in_xml(text: &[u8]) -> Result<Track> {
    let head = String::from_utf8_lossy(&text[..text.len().min(HEAD)]);
    let is = |root: &str| head.contains(&format!("<{root}"));
    if is("gpx") {
        return gpx::read(text);
    }
    if is("kml") {
        return kml::read(text);
    }
    if is("TrainingCenterDatabase") {
        return Err(Problem::bad_input("this is a TCX file, which is not read")
            .help("export the activity as GPX or FIT"));
    }
    Err(Problem::bad_input("this XML file is neither GPX nor KML")
        .help("export the track as GPX from the logger's software"))
}

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
