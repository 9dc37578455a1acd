//! Interruption: long-running work stops at its next check, so that temporary files are removed and finished ones stay
//! whole. The program installs the handler of Ctrl-C; this crate only keeps what was asked.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::diagnostic::{Problem, Result};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Files and folders that are still incomplete.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Removes everything that is still incomplete, for a process that is about to exit.
pub fn remove_unfinished() {
    for path in unfinished().iter() {
        // Nothing more can be done about what cannot be removed.
        let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
    }
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

/// Asks long-running work to stop. Returns whether it had been asked before.
pub fn request() -> bool {
    REQUESTED.swap(true, Ordering::Relaxed)
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
