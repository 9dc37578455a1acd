//! The search for effects that the model misses.

use bodyflight_discovery::progress::Progress;
use bodyflight_io::interrupt;
use bodyflight_verbs::discover::{Request, discover_flights};
use pyo3::prelude::*;

use crate::flight::Flight;
use crate::long::{Report, long};
use crate::problem::dictionary;

/// Passes on the share done, and stops the search after a signal.
struct Watched<'a>(&'a Report<'a>);

impl Progress for Watched<'_> {
    fn stage(&self, _name: &str) {}

    fn reached(&self, share: f64) {
        (self.0)(share);
    }

    fn is_cancelled(&self) -> bool {
        interrupt::requested()
    }
}

/// Searches for the effects that the model misses in `flights`, and checks them on the flights of `hold_out`.
///
/// Returns the dictionary of `bodyflight discover --json`. `progress` is called with the share done.
#[pyfunction]
#[pyo3(signature = (flights, *, hold_out = vec![], max_effects = 3, progress = None), text_signature = "(flights, *, hold_out=(), max_effects=3, progress=None)")]
pub(crate) fn discover(
    py: Python<'_>,
    flights: Vec<Flight>,
    hold_out: Vec<Flight>,
    max_effects: usize,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyAny>> {
    let options: Vec<_> = flights.iter().chain(&hold_out).map(|f| f.options).collect();
    let files = |flights: Vec<Flight>| flights.into_iter().map(|f| f.inner).collect::<Vec<_>>();
    let (flights, held_out) = (files(flights), files(hold_out));
    let request = Request { max_effects };
    let report = long(py, progress, |progress| {
        let options = |place: usize| options.get(place).copied().unwrap_or_default();
        discover_flights(&flights, &held_out, options, request, &Watched(progress))
    })?;
    dictionary(py, &report)
}
