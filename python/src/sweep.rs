//! Many runs of one flight, and the search for coefficients.

use std::sync::atomic::{AtomicUsize, Ordering};

use bodyflight_io::diagnostic::Problem;
use bodyflight_mvnx::recording::{FlightFrame, faults};
use bodyflight_replay::comparison::{CHANNELS, Channel, Comparison};
use bodyflight_replay::flight::Flight as ReplayedFlight;
use bodyflight_replay::variants::{TOGETHER, Variant, fly};
use bodyflight_verbs as verbs;
use bodyflight_verbs::tune::Search;
use numpy::PyArray2;
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::arguments::array;
use crate::arrays::rows;
use crate::flight::Flight;
use crate::long::{Report, long};
use crate::problem::{dictionary, raise, warn_of_doubt};

/// Simulates a flight once for each row of `factors` on all cores; m by 3: factors on the drag, lift and moment coefficients.
///
/// Returns the root mean square of measured minus simulated, m by 7 in the order of `Run.channels`; the row of a run that
/// diverges is NaN. Runs that diverge and a recording that cannot be trusted are warned of. The recording is read only once. `progress` is called with the share of the runs done.
#[pyfunction]
#[pyo3(signature = (flight, factors, *, start = "smoothed", progress = None))]
pub(crate) fn sweep(
    py: Python<'_>,
    flight: Flight,
    factors: &Bound<'_, PyAny>,
    start: &str,
    progress: Option<Py<PyAny>>,
) -> PyResult<Py<PyArray2<f64>>> {
    let factors = three_columns(factors)?;
    let of_start = flight.starting(start)?;
    let (found, doubt) = long(py, progress, |progress| {
        let mut recording = of_start.open(flight.options)?;
        let frames: Vec<FlightFrame> = recording.by_ref().collect::<Result<_, _>>()?;
        let doubt = faults(&recording.warnings());
        let counted = Counted::of(factors.len(), progress);
        let height = frames
            .first()
            .map_or(0.0, |frame| frame.pelvis.position.up());
        let share = factors.len().div_ceil(rayon::current_num_threads());
        let found = factors
            .par_chunks(TOGETHER.min(share).max(1))
            .map(|factors| {
                let found = swept(&of_start, &frames, height, factors)?;
                factors.iter().for_each(|_| counted.one_more());
                Ok(found)
            })
            .collect::<Result<Vec<_>, Problem>>()?;
        let found: Vec<_> = found.into_iter().flatten().collect();
        Ok((found, doubt))
    })?;
    let diverged = found.iter().filter(|row| row[0].is_nan()).count();
    let diverged = (diverged > 0).then(|| {
        format!(
            "{diverged} of {} runs diverge: their rows are NaN",
            found.len()
        )
    });
    for sentence in [doubt, diverged] {
        warn_of_doubt(py, sentence.as_deref())?;
    }
    rows(py, found)
}

/// Root mean squares of runs with these factors, which are flown together.
fn swept(
    flight: &ReplayedFlight,
    frames: &[FlightFrame],
    first_height: f64,
    factors: &[[f64; 3]],
) -> Result<Vec<[f64; CHANNELS]>, Problem> {
    let varied = factors.iter().map(|factors| {
        let mut flight = flight.clone();
        flight.subject = flight.subject.with_coefficients_times(*factors);
        let dynamics = flight.dynamics(first_height);
        Variant { flight, dynamics }
    });
    let varied: Vec<Variant> = varied.collect();
    let mut compared = vec![Comparison::default(); varied.len()];
    let diverged = fly(frames, &varied, &mut |index, pair| {
        compared[index].push(pair)
    })?;
    let rows = compared.iter().zip(diverged).map(|(compared, diverged)| {
        let rms = compared.rms();
        let row = Channel::ALL.map(|channel| rms.get(channel));
        diverged.map_or(row, |_| row.map(|_| f64::NAN))
    });
    Ok(rows.collect())
}

/// Counts runs on several threads, and reports the share done.
struct Counted<'a> {
    done: AtomicUsize,
    all: usize,
    report: &'a Report<'a>,
}

impl<'a> Counted<'a> {
    const fn of(all: usize, report: &'a Report<'a>) -> Self {
        Self {
            done: AtomicUsize::new(0),
            all,
            report,
        }
    }

    #[expect(clippy::cast_precision_loss, reason = "counts of runs")]
    fn one_more(&self) {
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.report)(done as f64 / self.all as f64);
    }
}

/// Reads the rows of factors. Returns an error unless each has three factors of 0 to 100.
fn three_columns(factors: &Bound<'_, PyAny>) -> PyResult<Vec<[f64; 3]>> {
    let factors = array::<f64>(factors, "factors", &[None, Some(3)])?;
    let rows = factors.as_slice()?.as_chunks().0;
    let refused = |index: usize| {
        let problem =
            Problem::bad_input("expected three factors of 0 to 100, on drag, lift and moment");
        raise(problem.at(format!("factors, row {index}")))
    };
    let possible = |row: &[f64; 3]| row.iter().all(|factor| (0.0..=100.0).contains(factor));
    match rows.iter().position(|row| !possible(row)) {
        Some(index) => Err(refused(index)),
        None => Ok(rows.to_vec()),
    }
}

/// Searches for the coefficients that reproduce flights best. Returns the dictionary of `bodyflight tune --json`. `progress` is
/// called with the share of the draws done.
#[pyfunction]
#[pyo3(
    signature = (flights, *, hold_out = vec![], draws = 200, spread = 0.3, seed = 0, per_segment = false, progress = None),
    text_signature = "(flights, *, hold_out=(), draws=200, spread=0.3, seed=0, per_segment=False, progress=None)"
)]
#[expect(clippy::too_many_arguments, reason = "one for each option")]
pub(crate) fn tune(
    py: Python<'_>,
    flights: Vec<Flight>,
    hold_out: Vec<Flight>,
    draws: usize,
    spread: f64,
    seed: u64,
    per_segment: bool,
    progress: Option<Py<PyAny>>,
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
    let report = long(py, progress, |progress| {
        let inner = |flights: &[Flight]| -> Vec<_> {
            flights.iter().map(|flight| flight.inner.clone()).collect()
        };
        let counted = Counted::of(draws, progress);
        verbs::tune::tune(&inner(&flights), &inner(&hold_out), search, options, || {
            counted.one_more()
        })
    })?;
    warn_of_doubt(py, report.doubt().as_deref())?;
    dictionary(py, &report)
}
