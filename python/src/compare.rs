//! Recordings of one maneuver beside each other.

use bodyflight_io::diagnostic::Problem;
use bodyflight_replay::comparison::Channel;
use bodyflight_verbs::compare::align::Align;
use bodyflight_verbs::compare::{Report, Settings, Side, Track, compare as compared};
use numpy::PyArray2;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

use crate::arrays::{parts, rows};
use crate::flight::Flight;
use crate::long::long;
use crate::problem::{dictionary, raise, warn_of_doubt};

/// Two flights at n times that belong together.
#[pyclass(frozen, module = "bodyflight")]
pub(crate) struct Comparison {
    /// Times in A and in B (s since frame 0); n by 2.
    #[pyo3(get)]
    time: Py<PyArray2<f64>>,
    /// Channels of A, in the order of `channels`; n by 7.
    #[pyo3(get)]
    a: Py<PyArray2<f64>>,
    /// Channels of B; n by 7.
    #[pyo3(get)]
    b: Py<PyArray2<f64>>,
    /// Names of joints and angles.
    #[pyo3(get)]
    joints: Vec<String>,
    /// Angles of A in the order of `joints` (rad); n by 45.
    #[pyo3(get)]
    a_angles: Py<PyArray2<f64>>,
    /// Angles of B (rad); n by 45.
    #[pyo3(get)]
    b_angles: Py<PyArray2<f64>>,
    /// How much further joints are turned in B (rad); n by 45.
    #[pyo3(get)]
    difference: Py<PyArray2<f64>>,
    /// Standard deviations of the differences by the errors of suits and alignment (rad); n by 45.
    #[pyo3(get)]
    deviation: Py<PyArray2<f64>>,
    /// The first difference with a sound effect, in words.
    #[pyo3(get)]
    first: String,
    /// Reason not to trust the effects, or None.
    #[pyo3(get)]
    doubt: Option<String>,
    /// The dictionary that `bodyflight compare --json` prints.
    #[pyo3(get)]
    report: Py<PyAny>,
}

#[pymethods]
impl Comparison {
    /// Names of the seven channels, with units.
    #[classattr]
    fn channels() -> Vec<&'static str> {
        Channel::ALL.map(Channel::key).to_vec()
    }

    /// Creates a comparison from its parts, as pickle does.
    #[new]
    #[expect(clippy::too_many_arguments, reason = "one for each part")]
    const fn new(
        time: Py<PyArray2<f64>>,
        a: Py<PyArray2<f64>>,
        b: Py<PyArray2<f64>>,
        joints: Vec<String>,
        a_angles: Py<PyArray2<f64>>,
        b_angles: Py<PyArray2<f64>>,
        difference: Py<PyArray2<f64>>,
        deviation: Py<PyArray2<f64>>,
        first: String,
        doubt: Option<String>,
        report: Py<PyAny>,
    ) -> Self {
        Self {
            time,
            a,
            b,
            joints,
            a_angles,
            b_angles,
            difference,
            deviation,
            first,
            doubt,
            report,
        }
    }

    fn __getnewargs__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        let names = [
            "time",
            "a",
            "b",
            "joints",
            "a_angles",
            "b_angles",
            "difference",
            "deviation",
            "first",
            "doubt",
            "report",
        ];
        parts(slf, &names)
    }
}

/// Compares flight `b` with flight `a`: which joints differ, and what that does by the model.
///
/// `align` is "auto", "turn", "exit", "start", "warp" or "time=TA,TB"; `between` are two times of `a` (s since frame 0), either
/// of which may be None. Raises a Disagreement if the flights cannot be aligned, and issues a DoubtWarning if the model misses
/// them by more than any difference does.
#[pyfunction]
#[pyo3(
    signature = (a, b, *, align = "auto", between = (None, None), names = ("A", "B"), progress = None),
    text_signature = "(a, b, *, align='auto', between=(None, None), names=('A', 'B'), progress=None)"
)]
pub(crate) fn compare(
    py: Python<'_>,
    a: Flight,
    b: Flight,
    align: &str,
    between: (Option<f64>, Option<f64>),
    names: (&str, &str),
    progress: Option<Py<PyAny>>,
) -> PyResult<Comparison> {
    let align = Align::parse(align).map_err(|expected| raise(Problem::bad_input(expected)))?;
    let settings = Settings {
        align,
        between: [between.0, between.1],
    };
    let (tracks, found) = long(py, progress, |progress| {
        let read = |name: &str, flight: &Flight| {
            Track::read(name, &flight.inner, flight.options, &mut |time| {
                progress(time)
            })
        };
        let tracks = [read(names.0, &a)?, read(names.1, &b)?];
        let found = compared([&tracks[0], &tracks[1]], settings)?;
        Ok((tracks, found))
    })?;
    let doubt = found.pair.doubt();
    warn_of_doubt(py, doubt.as_deref())?;
    let times = &found.differences.times;
    let channels = |side: usize| {
        let at = |pair: &(f64, f64)| if side == 0 { pair.0 } else { pair.1 };
        let row = |pair| Channel::ALL.map(|channel| tracks[side].channel(channel, at(pair)));
        rows(py, times.iter().map(row).collect())
    };
    let angles = |place: usize| {
        let row = |row: &Vec<[f64; 4]>| row.iter().map(|numbers| numbers[place]).collect();
        let all: Vec<Vec<f64>> = found.differences.rows.iter().map(row).collect();
        Ok::<_, PyErr>(PyArray2::from_vec2(py, &all)?.unbind())
    };
    Ok(Comparison {
        time: rows(py, times.iter().map(|(one, two)| [*one, *two]).collect())?,
        a: channels(0)?,
        b: channels(1)?,
        joints: found
            .differences
            .angles
            .iter()
            .map(ToString::to_string)
            .collect(),
        a_angles: angles(0)?,
        b_angles: angles(1)?,
        difference: angles(2)?,
        deviation: angles(3)?,
        first: found.pair.first.clone(),
        doubt,
        report: dictionary(
            py,
            &Report {
                a: Side::of(&tracks[0]),
                pairs: vec![found.pair],
            },
        )?,
    })
}
