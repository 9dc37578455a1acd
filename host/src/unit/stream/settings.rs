//! What to stream, and how.

use bodyflight_core::link::fault::Faults;

use super::connection::Target;

/// How fast samples go out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As a source that sets its own pace delivers them.
    Source,
    /// So many times faster than they were recorded.
    Times(f64),
    /// As fast as the unit grants credit; nothing is dropped.
    Max,
}

/// What to stream, and how.
#[derive(Debug, Clone)]
pub struct Settings {
    /// Where the unit is.
    pub target: Target,
    /// Filter preset.
    pub preset: String,
    /// How fast.
    pub pace: Pace,
    /// Faults of the line, on purpose.
    pub faults: Faults,
    /// Seed of the faults.
    pub seed: u64,
}
