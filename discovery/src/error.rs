//! Why a flight was not judged.

/// Why a search gave no report.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum Error {
    /// The flight is too short.
    #[error("expected at least {least_s} s of flight, found {found_s:.1} s")]
    TooShort {
        /// Shortest flight that is judged (s).
        least_s: f64,
        /// Length of the flight (s).
        found_s: f64,
    },
    /// No fall of the point is long enough.
    #[error("expected at least {least_s} s of free fall, found {found_s:.1} s")]
    NoFreeFall {
        /// Shortest fall that is judged (s).
        least_s: f64,
        /// Length of the longest fall (s).
        found_s: f64,
        /// Speed of descent of a free fall, at least (m/s).
        descent_mps: f64,
    },
    /// The caller cancelled the search.
    #[error("the search was cancelled")]
    Cancelled,
}

/// The result of a search.
pub type Result<T> = core::result::Result<T, Error>;
