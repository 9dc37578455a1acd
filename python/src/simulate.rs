//! A free run of the model beside a recording.

use bodyflight::replay::comparison::Channel;
use bodyflight::replay::steps::Step;
use bodyflight::verbs;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::arrays::{MotionArrays, Motions, rows};
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, unknown};

/// A run of n steps: what was measured and what the model did.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Run {
    /// Time since frame 0 (s); n.
    #[pyo3(get)]
    time: Py<PyArray1<f64>>,
    /// Measured channels, in the order of `channels`; n by 7.
    #[pyo3(get)]
    measured: Py<PyArray2<f64>>,
    /// The same of the model.
    #[pyo3(get)]
    simulated: Py<PyArray2<f64>>,
    /// Motion of the model's pelvis.
    #[pyo3(get)]
    motion: Py<MotionArrays>,
    /// What `bodyflight simulate --json` prints.
    #[pyo3(get)]
    report: Py<PyAny>,
}

#[pymethods]
impl Run {
    /// Names of the channels, with their units.
    #[classattr]
    fn channels() -> Vec<&'static str> {
        Channel::ALL.map(Channel::key).to_vec()
    }
}

#[derive(Default)]
struct Columns {
    time: Vec<f64>,
    measured: Vec<[f64; Channel::ALL.len()]>,
    simulated: Vec<[f64; Channel::ALL.len()]>,
    motion: Motions,
}

impl Columns {
    fn push(&mut self, step: &Step) {
        self.time.push(step.time);
        let pair = &step.pair;
        self.measured
            .push(Channel::ALL.map(|channel| channel.value(&pair.measured)));
        self.simulated
            .push(Channel::ALL.map(|channel| channel.value(&pair.simulated)));
        self.motion.push(&step.simulated);
    }
}

/// Runs the model over recorded postures from the first frame and compares it with the measured pelvis.
///
/// `start` is "smoothed" or "first", `precision` "double" or "single"; `progress` is called with the time reached (s).
#[pyfunction]
#[pyo3(signature = (flight, *, start = "smoothed", precision = "double", progress = None))]
pub(crate) fn simulate(
    py: Python<'_>,
    flight: Flight,
    start: &str,
    precision: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Run> {
    let of_start = flight.starting(start)?;
    let is_single = is_single(precision)?;
    let mut columns = Columns::default();
    let simulation = long(py, progress, |progress| {
        let each = |step: &Step| {
            columns.push(step);
            Ok(())
        };
        if is_single {
            verbs::simulate::simulate::<f32>(&of_start, flight.options, each, progress)
        } else {
            verbs::simulate::simulate::<f64>(&of_start, flight.options, each, progress)
        }
    })?;
    Ok(Run {
        time: PyArray1::from_vec(py, columns.time).unbind(),
        measured: rows(py, columns.measured)?,
        simulated: rows(py, columns.simulated)?,
        motion: columns.motion.arrays(py)?,
        report: dictionary(py, &simulation.report)?,
    })
}

/// Whether a precision by name is single.
pub(crate) fn is_single(precision: &str) -> PyResult<bool> {
    match precision {
        "double" => Ok(false),
        "single" => Ok(true),
        _ => Err(unknown("precision", precision, &["double", "single"])),
    }
}
