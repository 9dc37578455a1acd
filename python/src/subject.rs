//! A person, and the person's steady fall.

use std::path::PathBuf;

use bodyflight_core::Segment;
use bodyflight_replay::flight::DEFAULT_DENSITY;
use bodyflight_replay::subject;
use bodyflight_verbs as verbs;
use numpy::PyArray2;
use pyo3::prelude::*;

use crate::arrays::rows;
use crate::problem::{dictionary, raise};

/// A person as described by a `subject.toml`, or the default person if no path is given.
#[pyclass(frozen, from_py_object, module = "bodyflight")]
#[derive(Clone)]
pub(crate) struct Subject {
    pub(crate) inner: subject::Subject,
}

impl Subject {
    /// Returns the person of an optional argument: the default person if none is given.
    pub(crate) fn or_default(subject: Option<Self>) -> subject::Subject {
        subject.map_or_else(subject::Subject::default, |subject| subject.inner)
    }
}

/// Texts of a `subject.toml` and of the segment table that it refers to.
type Texts = (String, Option<String>);

#[pymethods]
impl Subject {
    #[new]
    #[pyo3(signature = (path = None))]
    fn new(path: Option<PathBuf>) -> PyResult<Self> {
        let inner = match path {
            Some(path) => subject::Subject::read(&path).map_err(raise)?,
            None => subject::Subject::default(),
        };
        Ok(Self { inner })
    }

    /// Creates a person from the text of a `subject.toml`, and that of the `segments.json` that it refers to, if any.
    #[staticmethod]
    #[pyo3(signature = (text, segments = None))]
    fn from_toml(text: &str, segments: Option<&str>) -> PyResult<Self> {
        let path = PathBuf::from("subject.toml");
        let parsed = match segments {
            Some(table) => subject::Subject::parse_with_table(text, table, &path),
            None => subject::Subject::parse(text, &path),
        };
        Ok(Self {
            inner: parsed.map_err(raise)?,
        })
    }

    /// Returns the text of a `subject.toml`.
    fn to_toml(&self) -> PyResult<String> {
        self.inner.to_toml().map_err(raise)
    }

    /// Text of the `segments.json` that the text of the `subject.toml` refers to, or None.
    #[getter]
    fn segments_json(&self) -> Option<&str> {
        self.inner.segments_json()
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<(Bound<'py, PyAny>, Texts)> {
        let own = slf.get();
        let texts = (own.to_toml()?, own.segments_json().map(str::to_owned));
        Ok((slf.get_type().getattr("from_toml")?, texts))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }

    /// Mass with equipment (kg).
    #[getter]
    fn mass(&self) -> f64 {
        self.inner.body().mass()
    }

    /// Names of the 16 segments, in the order of all arrays.
    #[classattr]
    fn segments() -> Vec<&'static str> {
        Segment::ALL.map(Segment::name).to_vec()
    }

    /// Returns the mass (kg) and length (m) of each segment, 16 by 2.
    fn segment_table(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        let body = self.inner.body();
        let table = Segment::ALL.map(|segment| {
            let parameters = &body.segments[segment];
            [parameters.mass, parameters.length]
        });
        rows(py, table.to_vec())
    }

    /// Returns the same person with the drag, lift and moment coefficients of all segments multiplied by these factors.
    #[pyo3(signature = (*, drag = 1.0, lift = 1.0, moment = 1.0))]
    fn scaled(&self, drag: f64, lift: f64, moment: f64) -> Self {
        let inner = self.inner.clone();
        Self {
            inner: inner.with_coefficients_times([drag, lift, moment]),
        }
    }

    fn __repr__(&self) -> String {
        format!("Subject(mass={:.1} kg)", self.mass())
    }
}

/// Finds the steady belly-to-earth fall in the neutral pose, in air of `density` (kg/m3). Returns the dictionary of
/// `bodyflight trim --json`.
#[pyfunction]
#[pyo3(signature = (subject = None, *, density = DEFAULT_DENSITY), text_signature = "(subject=None, *, density=1.0)")]
pub(crate) fn trim(py: Python<'_>, subject: Option<Subject>, density: f64) -> PyResult<Py<PyAny>> {
    let subject = subject.map_or_else(subject::Subject::default, |subject| subject.inner);
    let report = verbs::trim::trim(&subject, density).map_err(raise)?;
    dictionary(py, &report)
}
