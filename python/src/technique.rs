//! Movement patterns, and the response of the fall to each.

use bodyflight_io::diagnostic::Problem;
use bodyflight_verbs::technique::against::Expert;
use bodyflight_verbs::technique::linear::OUTPUT_NAMES;
use bodyflight_verbs::technique::response::{Point, Response};
use bodyflight_verbs::technique::{Settings, expert, joint_error, technique as analysed};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::parts;
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, raise, warn_of_doubt};

/// The k patterns of a movement in n frames, and the response of five outputs to each at m frequencies.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Technique {
    /// Time (s since frame 0); n.
    #[pyo3(get)]
    time: Py<PyArray1<f64>>,
    /// Names of joints and angles.
    #[pyo3(get)]
    joints: Vec<String>,
    /// Change of each angle per unit of a pattern; k by 45.
    #[pyo3(get)]
    weights: Py<PyArray2<f64>>,
    /// Standard deviations of the weights by joint errors; k by 45.
    #[pyo3(get)]
    deviation: Py<PyArray2<f64>>,
    /// The weights without what errors may have made, of length 1: responses are those of these movements; k by 45.
    #[pyo3(get)]
    told: Py<PyArray2<f64>>,
    /// Amplitude of each pattern (rad); n by k.
    #[pyo3(get)]
    amplitude: Py<PyArray2<f64>>,
    /// Frequencies of the responses (Hz); m, or 0 without a steady fall.
    #[pyo3(get)]
    frequency: Py<PyArray1<f64>>,
    /// Size of the response of each output, in its unit per rad of the pattern; k by 5 by m.
    #[pyo3(get)]
    gain: Py<PyArray3<f64>>,
    /// Standard deviation of the gain by the errors of the weights; k by 5 by m.
    #[pyo3(get)]
    gain_deviation: Py<PyArray3<f64>>,
    /// Phase of the response (rad); k by 5 by m.
    #[pyo3(get)]
    phase: Py<PyArray3<f64>>,
    /// Reason not to trust the result, or None.
    #[pyo3(get)]
    doubt: Option<String>,
    /// The dictionary that `bodyflight technique --json` prints.
    #[pyo3(get)]
    report: Py<PyAny>,
}

#[pymethods]
impl Technique {
    /// Names of the five outputs, with units.
    #[classattr]
    fn outputs() -> [&'static str; OUTPUT_NAMES.len()] {
        OUTPUT_NAMES
    }

    /// Creates a result from its parts, as pickle does.
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one for each part")]
    const fn new(
        time: Py<PyArray1<f64>>,
        joints: Vec<String>,
        weights: Py<PyArray2<f64>>,
        deviation: Py<PyArray2<f64>>,
        told: Py<PyArray2<f64>>,
        amplitude: Py<PyArray2<f64>>,
        frequency: Py<PyArray1<f64>>,
        gain: Py<PyArray3<f64>>,
        gain_deviation: Py<PyArray3<f64>>,
        phase: Py<PyArray3<f64>>,
        doubt: Option<String>,
        report: Py<PyAny>,
    ) -> Self {
        Self {
            time,
            joints,
            weights,
            deviation,
            told,
            amplitude,
            frequency,
            gain,
            gain_deviation,
            phase,
            doubt,
            report,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let names = [
            "time",
            "joints",
            "weights",
            "deviation",
            "told",
            "amplitude",
            "frequency",
            "gain",
            "gain_deviation",
            "phase",
            "doubt",
            "report",
        ];
        parts(slf, &names)
    }
}

/// Finds the movement patterns of `flight`, and how the fall of this body answers to each.
///
/// The turn pattern is compared with the best of the flights in `against`. `between` are two times (s since frame 0), either of
/// which may be None; `turns` analyses only turns; `joint_error_deg` is the joint error assumed, by default the flight's
/// tolerance. Issues a DoubtWarning if the result should not be trusted.
#[pyfunction]
#[pyo3(
    signature = (flight, *, against = Vec::new(), between = (None, None), turns = false, joint_error_deg = None),
    text_signature = "(flight, *, against=(), between=(None, None), turns=False, joint_error_deg=None)"
)]
pub(crate) fn technique(
    py: Python<'_>,
    flight: Flight,
    against: Vec<Flight>,
    between: (Option<f64>, Option<f64>),
    turns: bool,
    joint_error_deg: Option<f64>,
) -> PyResult<Technique> {
    let settings = Settings {
        from: between.0,
        to: between.1,
        turns,
        joint_error: joint_error("joint_error_deg", joint_error_deg).map_err(raise)?,
    };
    let whole = Settings {
        from: None,
        to: None,
        ..settings
    };
    let found = long(py, None, |_| {
        let experts = against
            .iter()
            .map(|other| expert(other.name(), &other.inner, &whole, other.options))
            .collect::<Result<Vec<Expert>, Problem>>()?;
        analysed(&flight.inner, &settings, &experts, flight.options)
    })?;
    let doubts = &found.report.doubts;
    let doubt = (!doubts.is_empty()).then(|| doubts.join("; "));
    warn_of_doubt(py, doubt.as_deref())?;
    let count = found.report.patterns.len();
    let components = &found.components[..count];
    let table = |rows: Vec<Vec<f64>>, width: usize| {
        let array = PyArray2::<f64>::zeros(py, [rows.len(), width], false);
        if rows.is_empty() {
            return Ok(array.unbind());
        }
        Ok::<_, PyErr>(PyArray2::from_vec2(py, &rows)?.unbind())
    };
    let of_joints =
        |part: &dyn Fn(usize) -> Vec<f64>| table((0..count).map(part).collect(), found.axes.len());
    let row = |frame: usize| {
        components
            .iter()
            .map(|each| each.amplitude[frame])
            .collect()
    };
    let answers = found
        .report
        .patterns
        .iter()
        .filter_map(|each| each.answer.as_ref());
    let responses: Vec<&[Response]> = answers.map(|answer| answer.responses.as_slice()).collect();
    let points = |of: &dyn Fn(&Point) -> f64| {
        let output = |response: &Response| response.bode.iter().map(of).collect::<Vec<_>>();
        let pattern = |all: &&[Response]| all.iter().map(output).collect::<Vec<_>>();
        let all: Vec<Vec<Vec<f64>>> = responses.iter().map(pattern).collect();
        if all.is_empty() {
            return Ok(PyArray3::<f64>::zeros(py, [0, OUTPUT_NAMES.len(), 0], false).unbind());
        }
        Ok::<_, PyErr>(PyArray3::from_vec3(py, &all)?.unbind())
    };
    let first = responses.first().and_then(|all| all.first());
    let frequencies = first.map_or(&[][..], |response| &response.bode);
    Ok(Technique {
        time: PyArray1::from_slice(py, &found.time).unbind(),
        joints: found.axes.iter().map(ToString::to_string).collect(),
        weights: of_joints(&|k| components[k].weights.as_slice().to_vec())?,
        deviation: of_joints(&|k| components[k].deviations.as_slice().to_vec())?,
        told: of_joints(&|k| components[k].told.as_slice().to_vec())?,
        amplitude: table((0..found.time.len()).map(row).collect(), count)?,
        frequency: PyArray1::from_iter(py, frequencies.iter().map(|point| point.frequency_hz))
            .unbind(),
        gain: points(&|point| point.gain)?,
        gain_deviation: points(&|point| point.gain_deviation)?,
        phase: points(&|point| point.phase_rad)?,
        doubt,
        report: dictionary(py, &found.report)?,
    })
}
