//! What to stream, and how.

use bodyflight_core::link::fault::Faults;

use super::connection::Target;

/// How fast samples are sent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// As delivered by a source that sets its own pace.
    Source,
    /// This many times faster than recorded.
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
    /// Faults injected into the line on purpose.
    pub faults: Faults,
    /// Seed of the faults.
    pub seed: u64,
}
