//! Settings of the unscented filter, their validation, and the limits of its state and covariance.

use nalgebra::{SMatrix, SVector};

use crate::math::{Real, clamp};

/// Floor and ceiling of a variance, as shares of its initial value.
const VARIANCE_RANGE: [f64; 2] = [1e-8, 1e4];

/// The square root of the covariance that spreads the sigma points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Root {
    /// The symmetric root, `S S = P`, as in the paper.
    Symmetric,
    /// The lower triangular root, `L L^T = P`: a quarter of the cost, but the spread depends on the order of the
    /// states.
    Cholesky,
}

/// Settings of a filter with `N` states.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings<T: Real, const N: usize> {
    /// Initial state.
    pub state: SVector<T, N>,
    /// Initial variance, diagonal of P.
    pub variance: SVector<T, N>,
    /// Variance added per update, diagonal of Q; a larger one follows changes faster and gives noisier estimates.
    pub process_noise: SVector<T, N>,
    /// Lower bounds of the state, paper eq. (minmax).
    pub low: SVector<T, N>,
    /// Upper bounds of the state.
    pub high: SVector<T, N>,
    /// Weight of the central point, W_0; a larger one spreads the other points wider.
    pub central_weight: T,
    /// Share by which a point beyond a bound is reflected to the other side if the state is at that bound, k of paper
    /// eq. (movepukf).
    pub reflection: T,
    /// Which square root of the covariance spreads the sigma points.
    pub root: Root,
}

/// Reason why settings are rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SettingsError {
    /// The central weight is not in 0 to 0.99; negative weights make covariances indefinite in single precision.
    CentralWeight,
    /// An initial variance is not finite and positive.
    Variance,
    /// The largest initial variance is more than 1e12 times the smallest.
    VarianceSpread,
    /// A process noise is negative, not finite, or more than a hundred times the initial variance.
    ProcessNoise,
    /// A lower bound is not below its upper bound.
    Bounds,
    /// The initial state is outside its bounds or not finite.
    State,
    /// The reflection is not in 0 to 1.
    Reflection,
    /// A measurement noise is not finite and positive.
    MeasurementNoise,
    /// The solution window is empty, longer than the prediction window, or not a multiple of the stride.
    SolutionWindow,
    /// The prediction window is empty, longer than the capacity of the estimator, or not a multiple of the stride.
    PredictionWindow,
    /// The time step is not positive, or an interval is longer than 0.05 s.
    TimeStep,
    /// The initial motion or posture is not finite.
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
    /// Checks whether a filter may run with these settings.
    ///
    /// # Errors
    /// Returns an error for the first rule that is broken.
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
    /// Clamps `state` to the bounds.
    #[inline]
    pub(super) fn limited(&self, state: &SVector<T, N>) -> SVector<T, N> {
        state.zip_zip_map(&self.low, &self.high, clamp)
    }

    /// Keeps variances within their range and correlations below one, and mirrors the lower triangle. Returns whether
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
