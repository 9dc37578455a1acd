//! Quality of the estimates over a part of a flight.

use std::fmt;

use bodyflight_core::link::{Estimate, EstimateFlags};

/// Sums over the estimates of a part.
#[derive(Debug, Clone, Copy, Default)]
pub struct Quality {
    pub estimates: u32,
    doubtful: u32,
    lost: u32,
    innovations: f64,
    /// Squared errors and variances, each of muscle input and of damping.
    errors: [f64; 2],
    variances: [f64; 2],
}

impl Quality {
    /// Columns of a table.
    pub const HEAD: &str = "estimates | doubtful, lost, % | NIS of a channel | muscle input: error, stated | damping: error, stated |";
    pub const RULE: &str = "---|---|---|---|---|";

    /// Adds an estimate with its true inputs: muscle input, then damping.
    pub fn take(&mut self, estimate: &Estimate, truth: &[f64; 6]) {
        self.estimates += 1;
        let has = |flag| u32::from(estimate.flags.contains(flag));
        self.doubtful += has(EstimateFlags::DOUBTFUL);
        self.lost += has(EstimateFlags::LOST);
        self.innovations += f64::from(estimate.nis);
        for (axis, truth) in truth.iter().enumerate() {
            let error = f64::from(estimate.state[axis]) - truth;
            self.errors[axis / 3] += error * error;
            self.variances[axis / 3] += f64::from(estimate.variance[axis]);
        }
    }

    fn mean(&self, sum: f64) -> f64 {
        sum / f64::from(self.estimates)
    }

    /// Root mean square per axis.
    fn of_axes(&self, sum: f64) -> f64 {
        (self.mean(sum) / 3.0).sqrt()
    }

    /// Checks that estimates are as good as in the first part of the flight, which includes the start.
    ///
    /// # Panics
    /// Panics if they are not.
    pub fn check(&self, first: &Self) {
        assert_eq!(self.lost, 0, "{self:?}");
        assert!(self.doubtful * 20 <= self.estimates, "{self:?}");
        // One, if the noise is as the filter assumes.
        assert!(
            (0.8..1.2).contains(&self.mean(self.innovations)),
            "{self:?}"
        );
        for kind in 0..2 {
            let [here, there] = [self, first].map(|part| part.of_axes(part.errors[kind]));
            let stated = self.of_axes(self.variances[kind]);
            assert!(
                here <= 1.2 * there && here <= 2.0 * stated,
                "{self:?}, at first {first:?}"
            );
        }
    }
}

impl fmt::Display for Quality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |count: u32| 100.0 * self.mean(f64::from(count));
        let [[muscle, muscle_stated], [damping, damping_stated]] = [0, 1]
            .map(|kind| [self.errors[kind], self.variances[kind]].map(|sum| self.of_axes(sum)));
        write!(
            f,
            "{} | {:.2}, {:.2} | {:.3} | {muscle:.4}, {muscle_stated:.4} | {damping:.3}, {damping_stated:.3} |",
            self.estimates,
            share(self.doubtful),
            share(self.lost),
            self.mean(self.innovations),
        )
    }
}
