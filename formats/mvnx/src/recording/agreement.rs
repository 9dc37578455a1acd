//! How well two records of one vector agree.

use nalgebra::Vector3;

/// Ratio of two sizes below which the smaller one does not show the motion at all.
pub(super) const NONE: f64 = 0.02;

/// Sums over a vector that is recorded in two ways.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Agreement {
    pub(super) expected: f64,
    pub(super) found: f64,
    both: f64,
}

impl Agreement {
    pub(super) fn add(&mut self, expected: &Vector3<f64>, found: &Vector3<f64>) {
        self.expected += expected.norm_squared();
        self.found += found.norm_squared();
        self.both += expected.dot(found);
    }

    pub(super) fn correlation(&self) -> f64 {
        self.both / (self.expected * self.found).sqrt().max(f64::MIN_POSITIVE)
    }

    /// Ratio of the found to the expected size, by regression.
    pub(super) fn scale(&self) -> f64 {
        self.both / self.expected.max(f64::MIN_POSITIVE)
    }

    /// Whether what was found does not show the motion at all.
    pub(super) fn is_empty(&self) -> bool {
        self.found < NONE * NONE * self.expected
    }
}
