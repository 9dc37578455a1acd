//! What tunes the filter, what it refuses, and the limits its state and covariance keep.

use nalgebra::{SMatrix, SVector};

use crate::math::{Real, clamp};

/// Floor and ceiling of a variance as shares of the variance at the start.
const VARIANCE_RANGE: [f64; 2] = [1e-8, 1e4];

/// Which square root of the covariance spreads the sigma points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Root {
    /// Symmetric, `S S = P`, as in the paper.
    Symmetric,
    /// Lower triangular, `L L^T = P`: a quarter of the cost, the spread depends on the order of the states.
    Cholesky,
}

/// What tunes the filter of `N` states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<T: Real, const N: usize> {
    /// State at the start.
    pub state: SVector<T, N>,
    /// Variance at the start, diagonal of P.
    pub variance: SVector<T, N>,
    /// Variance that the process adds with each update, diagonal of Q.
    pub process_noise: SVector<T, N>,
    /// Lower bounds of the state, paper eq. (minmax).
    pub low: SVector<T, N>,
    /// Upper bounds.
    pub high: SVector<T, N>,
    /// Weight of the central point, W_0.
    pub central_weight: T,
    /// Share by which a point beyond a bound that the state sits on goes to the other side, k of paper
    /// eq. (movepukf).
    pub reflection: T,
    /// Square root of the covariance.
    pub root: Root,
}

/// Why settings are refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingsError {
    /// The central weight is not in 0 to 0.99: negative weights make covariances indefinite in single
    /// precision.
    CentralWeight,
    /// A variance at the start is not finite and positive.
    Variance,
    /// The largest variance at the start is more than 1e12 times the smallest.
    VarianceSpread,
    /// A process noise is negative, not finite, or above a hundred times the variance at the start.
    ProcessNoise,
    /// A lower bound is not below its upper bound.
    Bounds,
    /// The state at the start is outside its bounds or not finite.
    State,
    /// The reflection is not in 0 to 1.
    Reflection,
    /// A measurement noise is not finite and positive.
    MeasurementNoise,
    /// The solution window is empty, longer than the prediction window, or no multiple of the stride.
    SolutionWindow,
    /// The prediction window is empty, longer than the estimator has room for, or no multiple of the stride.
    PredictionWindow,
    /// The time step is not positive, or an interval is longer than 0.05 s.
    TimeStep,
    /// Motion or posture at the start are not finite.
    Start,
}

impl core::fmt::Display for SettingsError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::CentralWeight => "central weight W0 must lie in 0 to 0.99",
            Self::Variance => "every variance at the start must be positive and finite",
            Self::VarianceSpread => "variances at the start may differ by a factor of 1e12 at most",
            Self::ProcessNoise => {
                "process noise must lie between 0 and 100 times the variance at the start"
            }
            Self::Bounds => "every lower bound must be below its upper bound",
            Self::State => "the state at the start must lie within its bounds",
            Self::Reflection => "the reflection k must lie in 0 to 1",
            Self::MeasurementNoise => "every measurement noise must be positive and finite",
            Self::SolutionWindow => {
                "the solution window must be a multiple of the filter's stride within the prediction window"
            }
            Self::PredictionWindow => {
                "the prediction window must be a multiple of the filter's stride that the estimator has room for"
            }
            Self::TimeStep => "the time step must be positive and an interval 0.05 s at most",
            Self::Start => "motion and posture at the start must be finite",
        })
    }
}

impl core::error::Error for SettingsError {}

impl<T: Real, const N: usize> Settings<T, N> {
    /// Whether a filter may run on these settings.
    ///
    /// # Errors
    /// Returns an error that names the first rule that is broken.
    pub fn check(&self) -> Result<(), SettingsError> {
        let (zero, one) = (T::zero(), T::one());
        let within = |value: T, low: T, high: T| value >= low && value <= high;
        let rule = |holds: bool, broken| if holds { Ok(()) } else { Err(broken) };
        rule(
            within(self.central_weight, zero, T::of(0.99)),
            SettingsError::CentralWeight,
        )?;
        rule(
            within(self.reflection, zero, one),
            SettingsError::Reflection,
        )?;
        let variance = &self.variance;
        rule(
            variance.iter().all(|v| v.is_finite() && *v > zero),
            SettingsError::Variance,
        )?;
        rule(
            variance.max() <= variance.min() * T::of(1e12),
            SettingsError::VarianceSpread,
        )?;
        let mut noise = self.process_noise.iter().zip(variance.iter());
        rule(
            noise.all(|(q, v)| within(*q, zero, *v * T::of(100.0))),
            SettingsError::ProcessNoise,
        )?;
        let mut bounds = self.low.iter().zip(self.high.iter());
        rule(bounds.all(|(low, high)| low < high), SettingsError::Bounds)?;
        let mut state = self.state.iter().zip(self.low.iter().zip(self.high.iter()));
        rule(
            state.all(|(x, (low, high))| x.is_finite() && within(*x, *low, *high)),
            SettingsError::State,
        )
    }
}

impl<T: Real, const N: usize> Settings<T, N> {
    /// `state` limited to the bounds.
    #[inline]
    pub(super) fn limited(&self, state: &SVector<T, N>) -> SVector<T, N> {
        state.zip_zip_map(&self.low, &self.high, clamp)
    }

    /// Keeps variances within their range and correlations below one; mirrors the lower triangle. Whether
    /// anything had to be changed.
    #[inline]
    pub(super) fn keep_positive(&self, covariance: &mut SMatrix<T, N, N>) -> bool {
        let mut changed = false;
        for k in 0..N {
            let [low, high] = VARIANCE_RANGE.map(|share| self.variance[k] * T::of(share));
            let variance = covariance[(k, k)];
            let kept = clamp(variance, low, high);
            changed |= variance < low || variance > high;
            covariance[(k, k)] = kept;
        }
        for k in 0..N {
            for j in 0..k {
                let product = covariance[(k, k)] * covariance[(j, j)] * T::of(0.9998);
                let value = covariance[(k, j)];
                let kept = if value * value > product {
                    changed = true;
                    clamp(value, -product.root(), product.root())
                } else {
                    value
                };
                covariance[(k, j)] = kept;
                covariance[(j, k)] = kept;
            }
        }
        changed
    }
}
