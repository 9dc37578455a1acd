//! What the model misses.

use bodyflight::diagnostic::Result;
use bodyflight::interrupt;
use bodyflight::verbs::discover::{problem, read_track, refuse_same};
use bodyflight_discovery::progress::Progress;
use bodyflight_discovery::search::{self, Settings};
use pyo3::prelude::*;

use crate::flight::Flight;
use crate::long::long_aside;
use crate::problem::dictionary;

/// Ends the search when a signal came.
struct Cancelled;

impl Progress for Cancelled {
    fn stage(&self, _name: &str) {}

    fn is_cancelled(&self) -> bool {
        interrupt::requested()
    }
}

/// Names the effect that the model misses in some flights, checked on others: the dictionary of `bodyflight discover --json`.
#[pyfunction]
#[pyo3(signature = (flights, *, hold_out = vec![], max_effects = 3, seed = 1))]
pub(crate) fn discover(
    py: Python<'_>,
    flights: Vec<Flight>,
    hold_out: Vec<Flight>,
    max_effects: usize,
    seed: u64,
) -> PyResult<Py<PyAny>> {
    let report = long_aside(py, || {
        for held_out in &hold_out {
            for flight in &flights {
                refuse_same(&flight.inner.recording, &held_out.inner.recording)?;
            }
        }
        let read = |flights: &[Flight]| -> Result<Vec<_>> {
            let tracks = flights.iter();
            tracks
                .map(|flight| read_track(&flight.inner, flight.options))
                .collect()
        };
        let (fitted, held_out) = (read(&flights)?, read(&hold_out)?);
        let settings = Settings {
            max_effects,
            seed,
            tolerances: flights
                .first()
                .map(|flight| flight.inner.tolerances)
                .unwrap_or_default(),
        };
        search::discover(&fitted, &held_out, &settings, &Cancelled).map_err(problem)
    })?;
    dictionary(py, &report)
}
