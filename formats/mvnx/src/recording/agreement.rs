//! How well two records of one vector agree, and where one of them is missing.

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

    /// Least and greatest ratio of the found to the expected size that noise allows: that of what is expected lowers the
    /// regression, that of what was found raises the inverse one.
    pub(super) fn scale_bounds(&self) -> [f64; 2] {
        [self.scale(), self.found / self.both.max(f64::MIN_POSITIVE)]
    }

    /// Whether what was found does not show the motion at all.
    pub(super) fn is_empty(&self) -> bool {
        self.found < NONE * NONE * self.expected
    }
}

/// Change in one frame (m or rad) above which the last digit of a file does not explain it.
const CHANGES: f64 = 2e-5;
/// Share of the frames that change along an axis with a rate of exactly zero along it that is no chance, and the fewest.
const EMPTY: f64 = 0.02;
const LEAST: u32 = 10;

/// Rates that are exactly zero although what they are rates of changes.
#[derive(Debug, Clone, Default)]
pub(super) struct Zeros {
    changing: [u32; 3],
    empty: [u32; 3],
    first: Option<f64>,
}

impl Zeros {
    /// Takes a change since the frame before, and the rate in the frame at this time (s).
    pub(super) fn see(&mut self, time: f64, change: &Vector3<f64>, rate: &Vector3<f64>) {
        for axis in (0..3).filter(|axis| change[*axis].abs() > CHANGES) {
            self.changing[axis] += 1;
            if rate[axis] == 0.0 {
                self.empty[axis] += 1;
                self.first.get_or_insert(time);
            }
        }
    }

    /// Frames with a zero, frames that change, and the time of the first zero (s), for the worst axis, if that is no chance.
    pub(super) fn found(&self) -> Option<(u32, u32, f64)> {
        let counts = self.empty.into_iter().zip(self.changing);
        let (empty, changing) = counts.max_by_key(|(empty, _)| *empty)?;
        let is_no_chance = empty > LEAST && f64::from(empty) > EMPTY * f64::from(changing);
        let first = self.first.filter(|_| is_no_chance)?;
        Some((empty, changing, first))
    }
}
