//! Long work: without the interpreter's lock, with progress, and with an ear for Ctrl-C.

use bodyflight::diagnostic::{Problem, Result};
use bodyflight::interrupt;
use pyo3::prelude::*;

use crate::problem::raise;

/// Runs `work` without the lock. It calls what it is given with the time reached (s), now and then: that looks for signals
/// and calls the user's function.
///
/// # Errors
/// Returns the problem of the work, or what the user's function raised.
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
                // The work looks for this next.
                interrupt::request();
            }
        })
    });
    ended(raised, result)
}

/// Runs `work` on another thread and without the lock, looking for signals meanwhile: for work that cannot call back.
///
/// # Errors
/// Returns the problem of the work, or what a signal raised.
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

/// The result of work that has ended. What was raised on the way had asked it to end, and comes first.
fn ended<R>(raised: Option<PyErr>, result: Result<R>) -> PyResult<R> {
    let Some(error) = raised else {
        return result.map_err(raise);
    };
    interrupt::forget();
    Err(error)
}
