//! Encoding of the arch factor on the drag: its source and a number.

use super::message::{ArchSource, Configure};
use crate::aerodynamics::ArchFactor;

impl ArchSource {
    /// Returns the fields `arch_source` and `arch` for a factor.
    pub const fn of(factor: ArchFactor<f32>) -> (Self, f32) {
        match factor {
            ArchFactor::FromPosture => (Self::Posture, 1.0),
            ArchFactor::Scaled(scale) => (Self::Scaled, scale),
            ArchFactor::Fixed(factor) => (Self::Fixed, factor),
        }
    }
}

impl Configure {
    /// Returns the factor that the fields describe.
    pub const fn arch_factor(&self) -> ArchFactor<f32> {
        match self.arch_source {
            ArchSource::Posture => ArchFactor::FromPosture,
            ArchSource::Scaled => ArchFactor::Scaled(self.arch),
            ArchSource::Fixed => ArchFactor::Fixed(self.arch),
        }
    }
}
