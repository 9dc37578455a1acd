//! The error type of all parts.

/// A result with an error message in one sentence.
pub type Result<T> = core::result::Result<T, String>;
