//! The page about loggers' tracks.

use std::path::PathBuf;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::progress;
use bodyflight_tracks::{self as tracks, folder};
use bodyflight_verbs::fall::page::{Entry, html};
use bodyflight_verbs::fall::units::Units;
use bodyflight_verbs::fall::{Conditions, falls, is_of_logger};

use bodyflight_replay::flight::name_of;

/// Whether the files are tracks, or folders that are no flights.
pub(super) fn are_tracks(paths: &[PathBuf]) -> bool {
    paths.iter().all(|path| is_of_logger(path))
}

/// The page about the tracks at `paths`, and its number of jumps.
pub(super) fn page(paths: &[PathBuf], mass: f64, units: Units) -> Result<(String, usize)> {
    let conditions = Conditions::of_mass(mass, "--mass")?;
    let mut files = Vec::new();
    for path in paths {
        files.extend(folder::tracks(path)?);
    }
    let (mut found, mut refused) = (Vec::new(), Vec::new());
    progress::stage("tracks");
    for (index, path) in files.iter().enumerate() {
        progress::reached(index, files.len())?;
        match tracks::read(path).and_then(|track| falls(&track, &conditions, path)) {
            Ok(falls) => found.push((path, falls)),
            Err(problem) if files.len() == 1 => return Err(problem),
            Err(problem) => refused.push(problem.to_string()),
        }
    }
    let entries: Vec<Entry<'_>> = (found.iter())
        .map(|(track, falls)| Entry { track, falls })
        .collect();
    let jumps = entries.iter().map(|entry| entry.falls.jumps.len()).sum();
    if jumps == 0 {
        return Err(
            Problem::bad_input(format!("none of the {} tracks has a jump", files.len()))
                .help(refused.first().cloned().unwrap_or_default()),
        );
    }
    let title = paths.first().map_or_else(String::new, |path| name_of(path));
    Ok((html(&title, &entries, &refused, units), jumps))
}
