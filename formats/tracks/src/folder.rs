//! Finds tracks in folders, such as a logger's card: by day, and for a FlySight 2 by time too.

use std::path::{Path, PathBuf};

use bodyflight_io::diagnostic::{Problem, Result};

/// Deepest folder that is searched.
const DEEPEST: usize = 6;

/// Endings of tracks' names; the content decides on the format.
const ENDINGS: [&str; 8] = [
    ".csv", ".gpx", ".kml", ".igc", ".nmea", ".fit", ".tes", ".ubx",
];

/// Files beside a FlySight 2's track that are no tracks of their own.
const OTHERS: [&str; 2] = ["sensor.csv", "event.csv"];

/// What the receiver itself wrote, which is the track where no other one is beside it.
const RAW: &str = "raw.ubx";

/// Whether a file is a logger's track, according to its name.
pub fn is_track(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    let name = name.to_string_lossy().to_lowercase();
    let packed = [".gz", ".xz"].iter().find_map(|end| name.strip_suffix(end));
    let name = packed.unwrap_or(&name);
    ENDINGS.iter().any(|ending| name.ends_with(ending)) && !name.starts_with('.')
}

/// The tracks at `path`: the file itself, or those in a folder and its folders, in order of their names.
///
/// # Errors
/// Returns an error if a folder cannot be read, or has no track.
pub fn tracks(path: &Path) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        return Ok(vec![path.to_path_buf()]);
    }
    if path.join("flight.toml").is_file() {
        return Err(
            Problem::bad_input("this is the folder of a flight, not of tracks")
                .in_file(path)
                .help("compare it with the model: bodyflight simulate FOLDER"),
        );
    }
    let mut found = Vec::new();
    search(path, 0, &mut found)?;
    if found.is_empty() {
        return Err(Problem::bad_input("this folder has no tracks")
            .in_file(path)
            .help(format!("names of tracks end in {}", ENDINGS.join(", "))));
    }
    found.sort();
    Ok(found)
}

fn search(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |error| Problem::system("read", folder, error);
    let (mut raw, before) = (Vec::new(), found.len());
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let (path, kind) = (entry.path(), entry.file_type().map_err(failed)?);
        let name = entry.file_name().to_string_lossy().to_lowercase();
        if kind.is_dir() {
            if depth < DEEPEST && !name.starts_with('.') {
                folders.push(path);
            }
        } else if name.starts_with(RAW) {
            raw.extend(is_track(&path).then_some(path));
        } else if is_track(&path) && !OTHERS.contains(&name.as_str()) {
            found.push(path);
        }
    }
    if found.len() == before {
        found.append(&mut raw);
    }
    folders
        .iter()
        .try_for_each(|folder| search(folder, depth + 1, found))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_card_has_the_tracks_of_its_days() {
        let card = tempfile::tempdir().unwrap();
        let problem = tracks(card.path()).unwrap_err().to_string();
        assert!(problem.contains("no tracks"), "{problem}");
        let day = card.path().join("24-07-14/07-22-54");
        std::fs::create_dir_all(&day).unwrap();
        for name in [
            "TRACK.CSV",
            "SENSOR.CSV",
            "RAW.UBX",
            "EVENT.CSV",
            "notes.txt",
        ] {
            std::fs::write(day.join(name), "").unwrap();
        }
        std::fs::write(card.path().join("a.gpx.gz"), "").unwrap();
        // A folder whose other files were lost.
        let raw = card.path().join("24-07-14/09-00-00");
        std::fs::create_dir_all(&raw).unwrap();
        std::fs::write(raw.join("RAW.UBX"), "").unwrap();
        let found = tracks(card.path()).unwrap();
        assert_eq!(
            found,
            [
                day.join("TRACK.CSV"),
                raw.join("RAW.UBX"),
                card.path().join("a.gpx.gz")
            ]
        );
    }
}
