//! Long work without the interpreter's lock, with progress and Ctrl-C.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use bodyflight_io::diagnostic::{Problem, Result};
use bodyflight_io::interrupt;
use bodyflight_io::progress::{Told, listen};
use pyo3::prelude::*;

use crate::problem::raise;
use crate::threads::threads;

/// What work calls with the flight time reached (s), or the share done.
pub(crate) type Report<'a> = dyn Fn(f64) + Sync + 'a;

/// Longest time between two looks for signals and for progress.
const LOOK: Duration = Duration::from_millis(10);

/// Runs `work` on this package's threads without the lock, and looks meanwhile for signals and for the progress that the
/// work has reported, about a hundred times a second. Only this thread can see signals; `progress` is called on it too.
///
/// # Errors
/// Returns an error if the work fails, or a signal handler or `progress` raises an exception.
pub(crate) fn long<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce(&Report<'_>) -> Result<R> + Send,
) -> PyResult<R> {
    reaching(py, progress, &Mutex::new(None), work)
}

/// Same as [`long`], for work that tells its progress to the listener of this process: the share done of each stage, or the
/// flight time reached (s).
///
/// # Errors
/// Same as [`long`].
pub(crate) fn told<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    work: impl FnOnce() -> Result<R> + Send,
) -> PyResult<R> {
    let reached = Arc::new(Mutex::new(None));
    let kept = Arc::clone(&reached);
    let listening = progress.is_some().then(|| {
        listen(move |told| match told {
            Told::Share(done) | Told::Time(done) => {
                *kept.lock().unwrap_or_else(PoisonError::into_inner) = Some(done);
            }
            Told::Stage(_) => {}
        })
    });
    let result = reaching(py, progress, &reached, |_| work());
    drop(listening);
    result
}

/// Runs `work`, and looks for what has been `reached`.
fn reaching<R: Send>(
    py: Python<'_>,
    progress: Option<Py<PyAny>>,
    reached: &Mutex<Option<f64>>,
    work: impl FnOnce(&Report<'_>) -> Result<R> + Send,
) -> PyResult<R> {
    let pool = threads(py)?;
    let done = AtomicBool::new(false);
    let caller = thread::current();
    let mut raised = None;
    let result = thread::scope(|scope| {
        let worker = scope.spawn(|| {
            let report =
                |done| *reached.lock().unwrap_or_else(PoisonError::into_inner) = Some(done);
            let result = pool.install(|| work(&report));
            done.store(true, Ordering::Release);
            caller.unpark();
            result
        });
        loop {
            py.detach(|| thread::park_timeout(LOOK));
            // A worker that panics is finished, but not done.
            let is_over = done.load(Ordering::Acquire) || worker.is_finished();
            let latest = reached
                .lock()
                .unwrap_or_else(PoisonError::into_inner)
                .take();
            if raised.is_none()
                && let Err(error) = look(py, progress.as_ref(), latest)
            {
                raised = Some(error);
                interrupt::request();
            }
            if is_over {
                break py.detach(|| worker.join());
            }
        }
    });
    // An exception raised meanwhile has interrupted the work, so it takes precedence over the work's own error.
    if let Some(error) = raised {
        interrupt::forget();
        return Err(error);
    }
    let panicked = || Problem::internal("a thread of this call panicked");
    result.unwrap_or_else(|_| Err(panicked())).map_err(raise)
}

/// Runs signal handlers, and passes on what the work has reached.
fn look(py: Python<'_>, progress: Option<&Py<PyAny>>, reached: Option<f64>) -> PyResult<()> {
    py.check_signals()?;
    if let (Some(progress), Some(reached)) = (progress, reached) {
        progress.call1(py, (reached,))?;
    }
    Ok(())
}
