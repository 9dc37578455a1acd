//! Long work without the interpreter's lock, with progress and Ctrl-C.

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use pyo3::prelude::*;

use crate::problem::raise;

/// Runs `work` without the lock. From time to time the work reports the flight time it has reached (s); each report checks for
/// signals and calls `progress`.
///
/// # Errors
/// Returns an error if the work fails or `progress` raises an exception.
pub(crate) fn long<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&mut dyn FnMut(f64)) -> Result<R> + Send,
) -> PyResult<R> {
    let mut raised = None;
    let result = py.detach(|| {
        work(&mut |time| {
            let outcome = Python::attach(|py| {
                py.check_signals()?;
                match &progress {
                    Some(call) => call.call1(py, (time,)).map(|_| ()),
                    None => Ok(()),
                }
            });
            if let Err(error) = outcome {
                raised.get_or_insert(error);
                // The work checks for interrupts after each report.
                interrupt::request();
            }
        })
    });
    ended(raised, result)
}

/// Runs `work`, which cannot report its progress, on another thread without the lock, and checks for signals meanwhile.
///
/// # Errors
/// Returns an error if the work fails or a signal handler raises an exception.
pub(crate) fn long_aside<R: Send>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<R> + Send,
) -> PyResult<R> {
    const LOOK: std::time::Duration = std::time::Duration::from_millis(10);
    let mut raised = None;
    let result = std::thread::scope(|scope| {
        let worker = scope.spawn(work);
        while !worker.is_finished() {
            py.detach(|| std::thread::sleep(LOOK));
            if let Err(error) = py.check_signals() {
                raised.get_or_insert(error);
                interrupt::request();
            }
        }
        worker.join()
    });
    let panicked = || Problem::internal("a thread of this call panicked");
    ended(raised, result.unwrap_or_else(|_| Err(panicked())))
}

/// Converts the result of finished work. An exception raised meanwhile has interrupted the work, so it takes precedence.
fn ended<R>(raised: Option<PyErr>, result: Result<R>) -> PyResult<R> {
    let Some(error) = raised else {
        return result.map_err(raise);
    };
    interrupt::forget();
    Err(error)
}
