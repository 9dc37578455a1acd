//! Floating-point precision of the model.

/// Floating-point precision of the model; a recording is always read in double precision.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Precision {
    /// As on the unit.
    Single,
    /// For reference.
    #[default]
    Double,
}
