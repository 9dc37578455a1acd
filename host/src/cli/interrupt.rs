//! Ctrl-C: running work stops cleanly, or is cut off if it takes too long to check.

use std::time::Duration;

use bodyflight_io::interrupt::{remove_unfinished, request};

use bodyflight_io::diagnostic::Kind;

/// Time that running work is given to stop cleanly.
const PATIENCE: Duration = Duration::from_millis(700);

/// Handles Ctrl-C from now on. The process ends within a second. If running work does not check in time, or on a second
/// Ctrl-C, unfinished files are removed, `last_words` is called, and the process exits.
pub(super) fn listen(last_words: impl Fn() + Clone + Send + 'static) {
    let leave = move || {
        remove_unfinished();
        last_words();
        std::process::exit(i32::from(Kind::Interrupted.exit_code()));
    };
    // If the handler cannot be installed, Ctrl-C ends the process as usual: nothing to report.
    let _ = ctrlc::set_handler(move || {
        if request() {
            leave();
        }
        let leave = leave.clone();
        std::thread::spawn(move || {
            std::thread::sleep(PATIENCE);
            leave();
        });
    });
}
