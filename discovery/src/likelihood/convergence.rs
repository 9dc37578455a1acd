//! Repeats the fit of a flight until it converges.

use crate::error::Result;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::progress::Progress;

/// Maximum number of fits with fixed slopes until the constants converge, the step at which they have converged
/// (standard errors, root mean square), and the ratio of successive steps above which the iteration is stopped.
const SETTLING: usize = 8;
const SETTLED_STEP: f64 = 0.1;
const STAGNANT: f64 = 0.8;

/// Maximum number of times slopes are recomputed, and the change of the log-likelihood from one to the next at which they
/// agree.
const RELINEARIZATIONS: usize = 8;
const AGREE: f64 = 3.0;
/// Number of such fits after which one that must become more likely than another, and is not, is given up.
const HOPEFUL: usize = 3;

impl FlightProblem<'_> {
    /// Repeats the fit around the constants it found until they converge, because likelihoods at other points of
    /// linearization cannot be compared.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn settled(&self, fitted: LinearFit, progress: &dyn Progress) -> Result<LinearFit> {
        let mut moved = fitted.moved();
        let mut best = fitted;
        for _ in 0..SETTLING {
            if moved < SETTLED_STEP {
                break;
            }
            let point = best.point_with(&best.point.effects);
            let Some(next) = self.fit_with_slopes_of(&best, &point, progress)? else {
                break;
            };
            let before = moved;
            (moved, best) = (next.moved(), next);
            if moved > STAGNANT * before {
                break;
            }
        }
        Ok(best)
    }

    /// Repeats the fit with slopes of its own until its likelihood stays the same, and returns the last.
    ///
    /// Slopes make the covariance. With those of another point a flight may seem more likely by 40 (joints off by 3
    /// degrees), so only fits with slopes of their own can be compared, and the most likely of several fits on the way is
    /// the one that is most wrong.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn converged(&self, fitted: LinearFit, progress: &dyn Progress) -> Result<LinearFit> {
        self.converged_above(f64::NEG_INFINITY, fitted, progress)
    }

    /// The same, but given up where it stays below a log-likelihood.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn converged_above(
        &self,
        least: f64,
        fitted: LinearFit,
        progress: &dyn Progress,
    ) -> Result<LinearFit> {
        let mut before = None;
        let mut last = if fitted.has_own_slopes() {
            before = Some(fitted.errors.likelihood);
            fitted
        } else {
            self.settled(fitted, progress)?
        };
        for times in 1..=RELINEARIZATIONS {
            let point = last.point_with(&last.point.effects);
            let Some(next) = self.fit(&point, Some(&last.errors), 1, progress)? else {
                break;
            };
            let likelihood = next.errors.likelihood;
            let has_converged =
                before.is_some_and(|before: f64| (likelihood - before).abs() < AGREE);
            (last, before) = (next, Some(likelihood));
            if has_converged || (times >= HOPEFUL && likelihood < least) {
                break;
            }
        }
        Ok(last)
    }
}
