//! Many runs of one flight, and the search for coefficients.

use bodyflight_io::interrupt;
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_replay::comparison::{Channel, Comparison};
use bodyflight_replay::steps::{Divergence, Replay};
use bodyflight_verbs as verbs;
use bodyflight_verbs::tune::Search;
use numpy::{PyArray2, PyReadonlyArray2};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arrays::rows;
use crate::flight::Flight;
use crate::long::long_aside;
use crate::problem::{dictionary, raise};

/// Simulates a flight once for each row of `factors` on all cores; m by 3: factors on the drag, lift and moment coefficients.
///
/// Returns the root mean square of measured minus simulated, m by 7 in the order of `Run.channels`. A run that diverges is
/// compared in its last plausible motion. The recording is read only once.
#[pyfunction]
#[pyo3(signature = (flight, factors, *, start = "smoothed"))]
pub(crate) fn sweep(
    py: Python<'_>,
    flight: Flight,
    factors: PyReadonlyArray2<'_, f64>,
    start: &str,
) -> PyResult<Py<PyArray2<f64>>> {
    let factors = three_columns(&factors)?;
    let of_start = flight.starting(start)?;
    let found = long_aside(py, || {
        let frames: Vec<FlightFrame> = of_start.open(flight.options)?.collect::<Result<_, _>>()?;
        factors
            .par_iter()
            .map(|factors| {
                interrupt::check()?;
                let mut varied = of_start.clone();
                varied.subject = varied.subject.with_coefficients_times(*factors);
                let frames = frames.iter().copied().map(Ok);
                let mut comparison = Comparison::default();
                let replay = Replay::new(&varied, frames)?;
                for step in replay.on_divergence(Divergence::Held) {
                    comparison.push(step?.pair);
                }
                let rms = comparison.rms();
                Ok(Channel::ALL.map(|channel| rms.get(channel)))
            })
            .collect::<Result<Vec<_>, _>>()
    })?;
    rows(py, found)
}

/// Reads the rows of factors. Returns an error unless each has three factors of 0 to 100.
fn three_columns(factors: &PyReadonlyArray2<'_, f64>) -> PyResult<Vec<[f64; 3]>> {
    use bodyflight_io::diagnostic::Problem;
    let rows = factors.as_array();
    rows.outer_iter()
        .enumerate()
        .map(|(index, row)| {
            let row: Vec<f64> = row.iter().copied().collect();
            <[f64; 3]>::try_from(row)
                .ok()
                .filter(|row| row.iter().all(|factor| (0.0..=100.0).contains(factor)))
                .ok_or_else(|| {
                    let problem = Problem::bad_input(
                        "expected three factors of 0 to 100, on drag, lift and moment",
                    );
                    raise(problem.at(format!("factors, row {index}")))
                })
        })
        .collect()
}

/// Searches for the coefficients that reproduce flights best. Returns the dictionary of `bodyflight tune --json`.
#[pyfunction]
#[pyo3(signature = (flights, *, hold_out = vec![], draws = 200, spread = 0.3, seed = 0, per_segment = false))]
pub(crate) fn tune(
    py: Python<'_>,
    flights: Vec<Flight>,
    hold_out: Vec<Flight>,
    draws: usize,
    spread: f64,
    seed: u64,
    per_segment: bool,
) -> PyResult<Py<PyAny>> {
    let search = Search {
        draws,
        spread,
        seed,
        per_segment,
    };
    let options = flights
        .first()
        .map(|flight| flight.options)
        .unwrap_or_default();
    let report = long_aside(py, || {
        let inner = |flights: &[Flight]| -> Vec<_> {
            flights.iter().map(|flight| flight.inner.clone()).collect()
        };
        verbs::tune::tune(&inner(&flights), &inner(&hold_out), search, options, || ())
    })?;
    dictionary(py, &report)
}
