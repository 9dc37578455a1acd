//! Threads for work on all cores. Those of a parent process do not survive a fork, so each process has its own.

use std::sync::{Mutex, PoisonError};

use bodyflight_io::diagnostic::Problem;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::problem::raise;

/// The threads, and the process that has them.
static THREADS: Mutex<Option<(u32, &'static ThreadPool)>> = Mutex::new(None);

/// Returns the threads of this process, one for each core.
///
/// The interpreter's lock is held, as it is by whoever forks through Python: no fork comes while the table is locked. The
/// threads of a parent process are left behind and never dropped, since dropping them would wait for them.
///
/// # Errors
/// Returns an error if the system refuses to start threads.
pub(crate) fn threads(_locked: Python<'_>) -> PyResult<&'static ThreadPool> {
    let mut threads = THREADS.lock().unwrap_or_else(PoisonError::into_inner);
    let own = std::process::id();
    if let Some((process, pool)) = *threads
        && process == own
    {
        return Ok(pool);
    }
    let pool = ThreadPoolBuilder::new()
        .thread_name(|index| format!("bodyflight {index}"))
        .build()
        .map_err(|error| raise(Problem::refused("cannot start threads").caused_by(error)))?;
    let pool: &'static ThreadPool = Box::leak(Box::new(pool));
    *threads = Some((own, pool));
    Ok(pool)
}

/// Does the work on flights side by side on the threads of a pool. One, two or three flights are not side by side and wake
/// no thread.
pub(crate) fn on_all_cores<F: Send>(
    pool: &ThreadPool,
    fours: &mut [F],
    work: impl FnOnce(&mut [F]) + Send,
) {
    if !fours.is_empty() {
        pool.install(|| work(fours));
    }
}
