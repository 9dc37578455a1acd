//! The search for effects that the model misses.

use bodyflight_discovery::progress::Progress;
use bodyflight_io::interrupt;
use bodyflight_verbs::discover::{Request, discover_flights};
use pyo3::prelude::*;

use crate::flight::Flight;
use crate::long::long;
use crate::problem::dictionary;

/// Stops the search after a signal.
struct Cancelled;

impl Progress for Cancelled {
    fn stage(&self, _name: &str) {}

    fn is_cancelled(&self) -> bool {
        interrupt::requested()
    }
}

/// Searches for the effects that the model misses in `flights`, and checks them on the flights of `hold_out`.
///
/// Returns the dictionary of `bodyflight discover --json`.
#[pyfunction]
#[pyo3(signature = (flights, *, hold_out = vec![], max_effects = 3, seed = 1), text_signature = "(flights, *, hold_out=(), max_effects=3, seed=1)")]
pub(crate) fn discover(
    py: Python<'_>,
    flights: Vec<Flight>,
    hold_out: Vec<Flight>,
    max_effects: usize,
    seed: u64,
) -> PyResult<Py<PyAny>> {
    let options: Vec<_> = flights.iter().chain(&hold_out).map(|f| f.options).collect();
    let files = |flights: Vec<Flight>| flights.into_iter().map(|f| f.inner).collect::<Vec<_>>();
    let (flights, held_out) = (files(flights), files(hold_out));
    let request = Request { max_effects, seed };
    let report = long(py, None, |_| {
        let options = |place: usize| options.get(place).copied().unwrap_or_default();
        discover_flights(&flights, &held_out, options, request, &Cancelled)
    })?;
    dictionary(py, &report)
}
