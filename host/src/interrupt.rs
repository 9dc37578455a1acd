//! Ctrl-C: long work ends at the next check, so temporary files are removed and finished ones stay whole. Work that is slow to
//! look is not waited for.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use crate::diagnostic::{Kind, Problem, Result};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Files and folders that are not whole yet.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// Time that work has to end by itself.
const PATIENCE: Duration = Duration::from_millis(700);

/// Listens for Ctrl-C from now on. The process ends within a second: by itself, or, where it does not look that often or at a
/// second Ctrl-C, after `last_words` and without what was not whole yet.
pub fn listen(last_words: impl Fn() + Clone + Send + 'static) {
    let leave = move || {
        for path in unfinished().iter() {
            // What cannot be removed is left: there is nobody to tell.
            let _ = std::fs::remove_file(path).or_else(|_| std::fs::remove_dir_all(path));
        }
        last_words();
        std::process::exit(i32::from(Kind::Interrupted.exit_code()));
    };
    // Without a handler Ctrl-C ends the process as usual: nothing to report.
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

/// A file or a folder that does not outlive the process while this is held.
#[derive(Debug)]
pub struct Unfinished(PathBuf);

impl Unfinished {
    /// Of a path.
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

/// Asks long work to end, for programs that listen themselves.
pub fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

/// Forgets a request whose work has ended, for programs that go on.
pub fn forget() {
    REQUESTED.store(false, Ordering::Relaxed);
}

/// Called now and then by long work.
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

/// Whether Ctrl-C was pressed, for work that has no end of its own, or a result so far.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
