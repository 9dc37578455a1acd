//! Export of flights for other programs, co-simulation units, and the program itself.

use std::ffi::OsString;
use std::path::PathBuf;

use bodyflight_estimation::motion::Method;
use bodyflight_io::destination;
use bodyflight_verbs::export::{self as exports, Format};
use bodyflight_verbs::fmu as units;
use pyo3::prelude::*;

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
    let method = match estimates {
        None => None,
        Some("filter") => Some(Method::Filter),
        Some("smooth") => Some(Method::Smooth),
        Some(name) => return Err(unknown("method", name, &["filter", "smooth"])),
    };
    destination::check([&out], force).map_err(raise)?;
    let report = long(py, progress, |progress| {
        let to = (out.as_path(), format);
        exports::export(&flight.inner, flight.options, to, method, progress)
    })?;
    warn_of_doubt(py, report.doubt.as_deref())?;
    dictionary(py, &report)
}

/// Writes a co-simulation unit for a subject.toml, or for the subject and the air of a flight.toml. Returns the dictionary of
/// `bodyflight fmu --json`.
///
/// `library` is the unit's shared library, by default the one in the package.
#[pyfunction]
#[pyo3(signature = (subject, out, *, library = None, force = false))]
pub(crate) fn fmu(
    py: Python<'_>,
    subject: PathBuf,
    out: PathBuf,
    library: Option<PathBuf>,
    force: bool,
) -> PyResult<Py<PyAny>> {
    let flight = bodyflight_replay::flight::Flight::read_person(&subject).map_err(raise)?;
    let library = units::library(library.as_deref()).map_err(raise)?;
    destination::check([&out], force).map_err(raise)?;
    dictionary(py, &units::write(&flight, &library, &out).map_err(raise)?)
}

/// Runs the program with `arguments`, of which the first is its name. Returns the exit code; help and wrong usage end the
/// process.
#[pyfunction]
pub(crate) fn program(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| bodyflight::cli::main(arguments))
}
