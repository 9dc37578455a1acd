//! Describes a file of another system by the recording made of it.

use std::path::Path;

use bodyflight_io::diagnostic::Result;
use bodyflight_mocap::mapping::Mapping;
use bodyflight_replay::subject::Subject;

use crate::import::{RECORDING_FILE, Request, import};
use crate::inspect::{Report, inspect};
use crate::validate::bundled;

/// Imports a file of another system and describes the recording made of it, with what the file shows besides.
///
/// # Errors
/// Returns an error if the file cannot be imported.
pub fn inspect_imported(
    file: &Path,
    mapping: Option<&Mapping>,
    person: Option<&Subject>,
) -> Result<Report> {
    let folder = bundled::temporary()?;
    let default = Subject::default();
    let imported = import(
        &Request {
            file,
            mapping,
            subject: person.unwrap_or(&default),
            has_subject: person.is_some(),
            folder: folder.path(),
        },
        &mut |_| {},
    )?;
    let body = person.map(Subject::body);
    let mut report = inspect(&folder.path().join(RECORDING_FILE), body.as_ref())?;
    let own = report
        .flight
        .as_ref()
        .map_or(&[][..], |flight| &flight.warnings);
    let own: Vec<String> = own.iter().map(ToString::to_string).collect();
    let faults = imported.faults();
    let is_said =
        |note: &String| own.contains(note) || faults.iter().any(|fault| fault.message == *note);
    let notes = imported.warnings.into_iter();
    report.notes = notes.filter(|note| !is_said(note)).collect();
    if let Some(flight) = &mut report.flight {
        flight.warnings.splice(0..0, faults);
    }
    Ok(report.judged(None))
}
