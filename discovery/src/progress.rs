//! Progress and cancellation of a search.

use crate::error::{Error, Result};

/// Receives the progress of a search, and may cancel it.
pub trait Progress: Sync {
    /// A stage of the search begins.
    fn stage(&self, name: &str);

    /// Reports that about this share of the search is done.
    fn reached(&self, _share: f64) {}

    /// Whether the search should stop. Polled regularly.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// Ignores progress and never cancels.
impl Progress for () {
    fn stage(&self, _name: &str) {}
}

/// Begins a stage.
pub(crate) fn begin(progress: &dyn Progress, name: &str) -> Result<()> {
    check(progress)?;
    progress.stage(name);
    Ok(())
}

/// Returns an error if the search was cancelled.
pub(crate) fn check(progress: &dyn Progress) -> Result<()> {
    if progress.is_cancelled() {
        Err(Error::Cancelled)
    } else {
        Ok(())
    }
}
