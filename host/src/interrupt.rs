//! Ctrl-C: long work ends at the next check, so temporary files are removed and finished ones stay whole.

use std::sync::atomic::{AtomicBool, Ordering};

use crate::diagnostic::{Problem, Result};

static REQUESTED: AtomicBool = AtomicBool::new(false);

/// Listens for Ctrl-C from now on; a second one ends the process at once.
pub fn listen() {
    // Without a handler Ctrl-C ends the process as usual: nothing to report.
    let _ = ctrlc::set_handler(|| {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(i32::from(crate::diagnostic::Kind::Interrupted.exit_code()));
        }
    });
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

/// Whether Ctrl-C was pressed, for work that has no end of its own: there it is the regular one.
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
