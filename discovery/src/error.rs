//! Errors of a search.

/// Reasons why a search returned no report.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Error {
    /// The flight is too short.
    #[error("expected at least {least_s} s of flight without a break, found {found_s:.1} s in all")]
    TooShort {
        /// Minimum duration of a flight (s).
        least_s: f64,
        /// Duration of all its parts (s).
        found_s: f64,
    },
    /// The caller cancelled the search.
    #[error("the search was cancelled")]
    Cancelled,
}

/// The result of a search.
pub type Result<T> = core::result::Result<T, Error>;
