//! Checks that the reduced filter adds to the paper's: every update is tested by a run of the model before it is
//! accepted, and the covariance is inflated when the filter has lost the motion.
//!
//! In rolls and flips the measurement is far from linear in the coefficients. The filter could then step too far, or
//! be overconfident in coefficients that were right a moment before, and the reconstructed motion would follow another
//! branch for seconds. Both checks cost the same whatever they find.
//!
//! A filter is lost if it is [`Health::Inconsistent`](super::status::Health). Inflating the covariance earlier
//! reconstructs flips better, but makes every flight sensitive to the last bit of rounding.

use nalgebra::SVector;

use super::coefficients::{STATES, StateVector, inputs_of_filter};
use super::measurement::{CHANNELS, MeasurementModel};
use super::status::INCONSISTENT;
use super::unscented::{Innovation, Unscented};
use super::window::Window;
use crate::dynamics::State;
use crate::dynamics::interval::Interval;
use crate::math::{Real, clamp};

/// Largest factor by which a lost filter inflates its variances per update.
const FADING: f64 = 2.0;

/// An update to be checked.
#[derive(Debug)]
pub struct Check<'a, T: Real> {
    /// The measured quantities.
    pub model: &'a MeasurementModel,
    /// The measurement at the end of the window.
    pub observation: &'a SVector<T, CHANNELS>,
    /// Diagonal of the measurement noise covariance R.
    pub noise: &'a SVector<T, CHANNELS>,
    /// Which channels were used.
    pub usable: &'a [bool; CHANNELS],
    /// Coefficients before the update.
    pub before: &'a StateVector<T>,
    /// Innovation of the update.
    pub innovation: &'a Innovation<T, CHANNELS>,
    /// Mean normalised innovation per channel over the last second.
    pub mean_normalised_innovation: T,
}

impl<T: Real> Check<'_, T> {
    /// Runs the model over the window from `start` with the updated coefficients and returns the state at its end. If
    /// that misses the measurement by more than the prediction did, the coefficients move halfway back. If the filter
    /// is lost, its variances are inflated.
    pub fn apply<I: Interval<T>, const N: usize>(
        &self,
        filter: &mut Unscented<T, STATES>,
        start: &State<T>,
        window: &Window<'_, T, I, N>,
    ) -> State<T> {
        let [end] = window.run(start, &[inputs_of_filter(filter.state())]);
        let seen = window.observe(&end, self.model);
        let missed = self.misfit(&self.model.difference(self.observation, &seen));
        // The comparison is false for NaN.
        let better = missed <= self.misfit(&self.innovation.innovation);
        if !better {
            filter.hold_back(self.before);
        }
        let lost = self.mean_normalised_innovation / T::of(INCONSISTENT);
        filter.fade(clamp(lost, T::one(), T::of(FADING)));
        end
    }

    /// Sum of squares, in units of the standard deviation of each channel.
    fn misfit(&self, difference: &SVector<T, CHANNELS>) -> T {
        let mut sum = T::zero();
        for (k, usable) in self.usable.iter().enumerate() {
            if *usable {
                sum += difference[k] * difference[k] / self.noise[k];
            }
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::estimator::preset::TRACKING_ON_BACK;
    use crate::estimator::unscented::Root;

    type Filter = Unscented<f64, STATES>;

    fn filter() -> Filter {
        Filter::new(TRACKING_ON_BACK.settings(Root::Cholesky).unwrap()).unwrap()
    }

    /// A filter that has processed a measurement of all its states.
    fn sure(noise: f64) -> Filter {
        let mut filter = filter();
        let points = filter.sigma_points();
        let slope = nalgebra::SMatrix::<f64, STATES, STATES>::from_fn(|row, column| {
            if row == column { 1.0 } else { 0.2 }
        });
        let moments = filter.linear_moments(&points, filter.state(), &slope);
        let nothing = SVector::<f64, STATES>::zeros();
        let noise = SVector::repeat(noise);
        filter.update(&moments, &nothing, &noise, &[true; STATES]);
        filter
    }

    proptest! {
        #[test]
        fn fading_keeps_the_covariance_whole_and_below_where_it_started(
            noise in 1e-6..10.0, factor in 0.0..1e3, times in 1usize..20,
        ) {
            let mut faded = sure(noise);
            let before = *faded.covariance();
            for _ in 0..times {
                faded.fade(factor);
            }
            let after = faded.covariance();
            prop_assert_eq!(*after, after.transpose());
            prop_assert!(after.cholesky().is_some());
            for k in 0..STATES {
                let start = filter().covariance()[(k, k)];
                prop_assert!(after[(k, k)] >= before[(k, k)]);
                prop_assert!(after[(k, k)] <= before[(k, k)].max(start * (1.0 + 1e-12)));
            }
            let unchanged = sure(noise);
            prop_assert_eq!(faded.state(), unchanged.state());
        }
    }

    #[test]
    fn fading_by_one_changes_no_bit_and_holding_back_goes_halfway() {
        let mut filter = sure(0.1);
        let before = filter;
        filter.fade(1.0);
        assert_eq!(filter, before);
        let other = filter.state() * 3.0;
        filter.hold_back(&other);
        assert!((filter.state() - before.state() * 2.0).norm() < 1e-12);
    }
}
