//! Estimates of muscle input and damping over time.

use std::path::PathBuf;

use bodyflight_estimation::Filter;
use bodyflight_estimation::motion::Method;
use bodyflight_estimation::request::Request;
use bodyflight_io::destination;
use bodyflight_io::files::write_file;
use bodyflight_replay::input_history::InputRow;
use bodyflight_replay::preset_file::Tuning;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{parts, rows};
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, raise, unknown, warn_of_doubt};
use crate::simulate::precision_of;

/// Number of estimated coefficients.
const INPUTS: usize = InputRow::COLUMNS.len() - 1;

/// Estimates at n instants.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Estimation {
    /// Start of the interval in which the coefficients act (s); n.
    #[pyo3(get)]
    time: Py<PyArray1<f64>>,
    /// Coefficients in the order of `columns`; n by 6.
    #[pyo3(get)]
    inputs: Py<PyArray2<f64>>,
    /// Standard deviations of the coefficients; n by 6.
    #[pyo3(get)]
    deviation: Py<PyArray2<f64>>,
    /// Normalised innovation squared; n.
    #[pyo3(get)]
    nis: Py<PyArray1<f64>>,
    /// "consistent", "doubtful" or "lost" at each instant; empty if the filter has no check of its own consistency.
    #[pyo3(get)]
    consistency: Vec<String>,
    /// Reason not to trust the estimate, or None.
    #[pyo3(get)]
    doubt: Option<String>,
    /// The dictionary that `bodyflight estimate --json` prints.
    #[pyo3(get)]
    report: Py<PyAny>,
    /// The text of the table that `write_csv` writes.
    #[pyo3(get, name = "_table")]
    table: String,
}

#[pymethods]
impl Estimation {
    /// Names of the six coefficients.
    #[classattr]
    fn columns() -> Vec<&'static str> {
        let [_, columns @ ..] = InputRow::COLUMNS;
        columns.to_vec()
    }

    /// Writes the table of `bodyflight estimate --out`, which a `flight.toml` can name as its `inputs`. A file that exists is
    /// replaced only with `force`.
    #[pyo3(signature = (path, *, force = false))]
    fn write_csv(&self, path: PathBuf, force: bool) -> PyResult<()> {
        destination::check([&path], force).map_err(raise)?;
        write_file(&path, self.table.as_bytes()).map_err(raise)
    }

    /// Creates an estimation from its parts, as pickle does.
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one for each part")]
    fn new(
        time: Py<PyArray1<f64>>,
        inputs: Py<PyArray2<f64>>,
        deviation: Py<PyArray2<f64>>,
        nis: Py<PyArray1<f64>>,
        consistency: Vec<String>,
        doubt: Option<String>,
        report: Py<PyAny>,
        table: String,
    ) -> Self {
        Self {
            time,
            inputs,
            deviation,
            nis,
            consistency,
            doubt,
            report,
            table,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let names = [
            "time",
            "inputs",
            "deviation",
            "nis",
            "consistency",
            "doubt",
            "report",
            "_table",
        ];
        parts(slf, &names)
    }
}

/// Estimates muscle input and damping over time, and compares the simulation with and without them.
///
/// `preset` is the name of a built-in preset or the path of a preset.toml, `method` is "filter" or "smooth", and `filter` is
/// "paper" or "reduced". Issues a DoubtWarning if the result should not be trusted.
#[pyfunction]
#[pyo3(signature = (flight, *, preset = "auto", method = "filter", filter = None, precision = "double", progress = None))]
pub(crate) fn estimate(
    py: Python<'_>,
    flight: Flight,
    preset: &str,
    method: &str,
    filter: Option<&str>,
    precision: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Estimation> {
    let request = request(preset, method, filter)?;
    let precision = precision_of(precision)?;
    let found = long(py, progress, |progress| {
        request.run(&flight.inner, flight.options, precision, &mut |time| {
            progress(time);
        })
    })?;
    warn_of_doubt(py, found.report.doubt.as_deref())?;
    let points = &found.points;
    let of = |row: &InputRow| -> [f64; INPUTS] {
        let [_, columns @ ..] = row.columns();
        columns
    };
    Ok(Estimation {
        time: PyArray1::from_iter(py, points.iter().map(|point| point.time)).unbind(),
        inputs: rows(py, points.iter().map(|point| of(&point.inputs)).collect())?,
        deviation: rows(
            py,
            points.iter().map(|point| of(&point.deviation)).collect(),
        )?,
        nis: PyArray1::from_iter(py, points.iter().map(|point| point.normalised_innovation))
            .unbind(),
        consistency: points
            .iter()
            .filter_map(|point| Some(point.consistency?.name().to_owned()))
            .collect(),
        doubt: found.report.doubt.clone(),
        report: dictionary(py, &found.report)?,
        table: text_of(&found),
    })
}

/// The request with these names.
pub(crate) fn request(preset: &str, method: &str, filter: Option<&str>) -> PyResult<Request> {
    Ok(Request {
        tuning: Tuning::find(preset).map_err(raise)?,
        method: method_of(method)?,
        filter: match filter {
            None => None,
            Some("paper") => Some(Filter::Paper),
            Some("reduced") => Some(Filter::Reduced),
            Some(name) => return Err(unknown("filter", name, &["paper", "reduced"])),
        },
    })
}

/// The table of coefficients over time, as text.
fn text_of(found: &bodyflight_estimation::Estimation) -> String {
    let columns = bodyflight_estimation::Estimation::columns().join(",");
    let rows = found.rows().map(|row| row.join(","));
    let mut text: String = std::iter::once(columns)
        .chain(rows)
        .collect::<Vec<_>>()
        .join("\n");
    text.push('\n');
    text
}

/// Returns the method of this name.
pub(crate) fn method_of(name: &str) -> PyResult<Method> {
    match name {
        "filter" => Ok(Method::Filter),
        "smooth" => Ok(Method::Smooth),
        _ => Err(unknown("method", name, &["filter", "smooth"])),
    }
}
