//! The arch factor on the drag over the link: where it comes from, and a number.

use super::message::{ArchSource, Configure};
use crate::aerodynamics::ArchFactor;

impl ArchSource {
    /// The fields `arch_source` and `arch` for a factor.
    pub const fn of(factor: ArchFactor<f32>) -> (Self, f32) {
        match factor {
            ArchFactor::FromPosture => (Self::Posture, 1.0),
            ArchFactor::Scaled(scale) => (Self::Scaled, scale),
            ArchFactor::Fixed(factor) => (Self::Fixed, factor),
        }
    }
}

impl Configure {
    /// The factor that the fields stand for.
    pub const fn arch_factor(&self) -> ArchFactor<f32> {
        match self.arch_source {
            ArchSource::Posture => ArchFactor::FromPosture,
            ArchSource::Scaled => ArchFactor::Scaled(self.arch),
            ArchSource::Fixed => ArchFactor::Fixed(self.arch),
        }
    }
}
