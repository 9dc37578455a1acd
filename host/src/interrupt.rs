//! Ctrl-C: long-running work stops at its next check, so that temporary files are removed and finished ones stay whole.
//! Work that takes too long to check is cut off.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::diagnostic::{Kind, Problem, Result};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Files and folders that are still incomplete.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Time that running work is given to stop cleanly.
const PATIENCE: Duration = Duration::from_millis(700);

/// Handles Ctrl-C from now on. The process ends within a second. If running work does not check in time, or on a second
/// Ctrl-C, unfinished files are removed, `last_words` is called, and the process exits.
pub fn listen(last_words: impl Fn() + Clone + Send + 'static) {
    let leave = move || {
        for path in unfinished().iter() {
            // Ignore files that cannot be removed: the process is about to exit.
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
        }
        last_words();
        std::process::exit(i32::from(Kind::Interrupted.exit_code()));
    };
    // If the handler cannot be installed, Ctrl-C ends the process as usual: nothing to report.
    let _ = ctrlc::set_handler(move || {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            leave();
        }
        let leave = leave.clone();
        std::thread::spawn(move || {
            std::thread::sleep(PATIENCE);
            leave();
        });
    });
}

fn unfinished() -> std::sync::MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file or folder that is removed if the process is interrupted while this value is alive.
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Registers a path.
    pub fn new(path: &Path) -> Self {
        unfinished().insert(path.to_path_buf());
        Self(path.to_path_buf())
    }
}

impl Drop for Unfinished {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

/// Asks long-running work to stop, for programs that handle Ctrl-C themselves.
pub fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

/// Clears a request whose work has stopped, for programs that continue.
pub fn forget() {
    REQUESTED.store(false, Ordering::Relaxed);
}

/// Called periodically by long-running work.
///
/// # Errors
/// Returns an error if Ctrl-C was pressed.
pub fn check() -> Result<()> {
    if requested() {
        Err(Problem::interrupted())
    } else {
        Ok(())
    }
}

/// Whether Ctrl-C was pressed, for work that runs until interrupted or that has a partial result.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
