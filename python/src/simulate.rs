//! A free run of the model, compared with a recording.

use bodyflight_replay::Precision;
use bodyflight_replay::comparison::Channel;
use bodyflight_replay::steps::Step;
use bodyflight_verbs as verbs;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{MotionArrays, Motions, parts, rows};
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, unknown};

/// A run of n steps: measured and simulated motion.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Run {
    /// Time since frame 0 (s); n.
    #[pyo3(get)]
    time: Py<PyArray1<f64>>,
    /// Measured channels, in the order of `channels`; n by 7.
    #[pyo3(get)]
    measured: Py<PyArray2<f64>>,
    /// Simulated channels, in the order of `channels`; n by 7.
    #[pyo3(get)]
    simulated: Py<PyArray2<f64>>,
    /// Simulated motion of the pelvis.
    #[pyo3(get)]
    motion: Py<MotionArrays>,
    /// The dictionary that `bodyflight simulate --json` prints.
    #[pyo3(get)]
    report: Py<PyAny>,
}

#[pymethods]
impl Run {
    /// Names of the seven channels, with units.
    #[classattr]
    fn channels() -> Vec<&'static str> {
        Channel::ALL.map(Channel::key).to_vec()
    }

    /// Creates a run from its parts, as pickle does.
    #[new]
    const fn new(
        time: Py<PyArray1<f64>>,
        measured: Py<PyArray2<f64>>,
        simulated: Py<PyArray2<f64>>,
        motion: Py<MotionArrays>,
        report: Py<PyAny>,
    ) -> Self {
        Self {
            time,
            measured,
            simulated,
            motion,
            report,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        parts(slf, &["time", "measured", "simulated", "motion", "report"])
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

/// Simulates a flight from its first frame and its recorded postures alone, and compares the motion with that measured at the
/// pelvis.
///
/// `start` is "smoothed" or "first", `precision` is "double" or "single"; `progress` is called with the flight time reached (s).
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
    let precision = precision_of(precision)?;
    let mut columns = Columns::default();
    let simulation = long(py, progress, |progress| {
        let each = &mut |step: &Step| {
            columns.push(step);
            Ok(())
        };
        verbs::simulate::simulate(&of_start, flight.options, precision, each, &mut |time| {
            progress(time)
        })
    })?;
    Ok(Run {
        time: PyArray1::from_vec(py, columns.time).unbind(),
        measured: rows(py, columns.measured)?,
        simulated: rows(py, columns.simulated)?,
        motion: columns.motion.arrays(py)?,
        report: dictionary(py, &simulation.report)?,
    })
}

/// Returns the precision of this name.
pub(crate) fn precision_of(precision: &str) -> PyResult<Precision> {
    match precision {
        "double" => Ok(Precision::Double),
        "single" => Ok(Precision::Single),
        _ => Err(unknown("precision", precision, &["double", "single"])),
    }
}
