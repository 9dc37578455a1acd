//! Export of flights for other programs, co-simulation units, and the program itself.

use std::ffi::OsString;
use std::path::PathBuf;

use bodyflight_io::destination;
use bodyflight_replay::flight::Flight as Recorded;
use bodyflight_verbs::export::{self as exports, Format};
use bodyflight_verbs::fmu::{self as units, Standard};
use pyo3::prelude::*;

use crate::estimate::method_of;
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, raise, unknown, warn_of_doubt};

/// Writes every frame of a flight and of its simulation. Returns the dictionary of `bodyflight export --json`.
///
/// `format` is "parquet", "csv", "mcap" or "npz", by default the extension of `out`; `estimates` is None, "filter" or "smooth".
/// Issues a DoubtWarning if the estimates should not be trusted.
#[pyfunction]
#[pyo3(signature = (flight, out, *, format = None, estimates = None, force = false, progress = None))]
pub(crate) fn export(
    py: Python<'_>,
    flight: Flight,
    out: PathBuf,
    format: Option<&str>,
    estimates: Option<&str>,
    force: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let names = Format::ALL.map(Format::name);
    let format = match format {
        None => Format::of(&out).map_err(raise)?,
        Some(name) => Format::from_name(name).ok_or_else(|| unknown("format", name, &names))?,
    };
    let method = estimates.map(method_of).transpose()?;
    destination::check([&out], force).map_err(raise)?;
    let mut arguments = vec![
        "bodyflight.export".to_owned(),
        flight.asked_path().display().to_string(),
        out.display().to_string(),
    ];
    arguments.extend(estimates.map(|method| format!("estimates={method}")));
    let report = long(py, progress, |progress| {
        let to = (out.as_path(), format);
        let (inner, options) = (&flight.inner, flight.options);
        exports::export(inner, options, to, method, &arguments, &mut |time| {
            progress(time)
        })
    })?;
    warn_of_doubt(py, report.doubt.as_deref())?;
    dictionary(py, &report)
}

/// Writes a co-simulation unit for a subject.toml, or for the subject and the air of a flight.toml. Returns the dictionary of
/// `bodyflight fmu --json`.
///
/// `fmi` is the version of the standard, "3.0" or "2.0"; `library` is the unit's shared library, by default the one in the package.
#[pyfunction]
#[pyo3(signature = (subject, out, *, fmi = "3.0", library = None, force = false))]
pub(crate) fn fmu(
    py: Python<'_>,
    subject: PathBuf,
    out: PathBuf,
    fmi: &str,
    library: Option<PathBuf>,
    force: bool,
) -> PyResult<Py<PyAny>> {
    let flight = Recorded::read_person(&subject).map_err(raise)?;
    let names = Standard::ALL.map(Standard::name);
    let standard =
        Standard::from_name(fmi).ok_or_else(|| unknown("version of FMI", fmi, &names))?;
    let library = units::library(library.as_deref()).map_err(raise)?;
    destination::check([&out], force).map_err(raise)?;
    let report = units::write(&flight, standard, &library, &out).map_err(raise)?;
    dictionary(py, &report)
}

/// Runs the program with `arguments`, of which the first is its name. Returns the exit code; help and wrong usage end the
/// process.
#[pyfunction]
pub(crate) fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| bodyflight::cli::main(arguments))
}
