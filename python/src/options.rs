//! How flights by actions begin and what they fly in.

use bodyflight_io::diagnostic::Problem;
use bodyflight_verbs::view::page::setup;
use bodyflight_viewer::cockpit::STARTS;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::problem::{raise, unknown};
use crate::skydiver::Course;
use crate::subject::Subject;

/// How flights begin, by the names that they have in Python.
#[derive(Clone)]
pub(crate) struct Options {
    pub(crate) start: String,
    pub(crate) subject: Option<Subject>,
    pub(crate) density: f64,
    pub(crate) substeps: u32,
}

impl Options {
    /// Checks the options, and creates the course of their flights.
    ///
    /// # Errors
    /// Returns an error if the start is unknown, or a value is outside its range.
    pub(crate) fn course(&self) -> PyResult<Course<f32>> {
        let names = STARTS.map(|start| start.name);
        let found = STARTS.iter().find(|known| known.name == self.start);
        let start = found.ok_or_else(|| unknown("start", &self.start, &names))?;
        let (density, substeps) = (self.density, self.substeps);
        if !(density > 0.0 && density <= 2.0) || substeps == 0 {
            return Err(raise(Problem::bad_input(format!(
                "expected a density above 0 and up to 2 kg/m3 and at least one substep, found {density} and {substeps}"
            ))));
        }
        let subject = Subject::or_default(self.subject.clone());
        Ok(Course::new(&setup(&subject, density), start, substeps))
    }

    /// Returns the options as keyword arguments.
    pub(crate) fn keywords<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let keywords = PyDict::new(py);
        keywords.set_item("start", &self.start)?;
        keywords.set_item("subject", self.subject.clone())?;
        keywords.set_item("density", self.density)?;
        keywords.set_item("substeps", self.substeps)?;
        Ok(keywords)
    }
}
