//! What went wrong, told by every part.

/// What went wrong, in a sentence.
pub type Result<T> = core::result::Result<T, String>;
