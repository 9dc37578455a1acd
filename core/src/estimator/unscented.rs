//! An unscented filter for parameters that change by process noise alone: bounded sigma points, moments, update.
//!
//! Implements the paper's section "The Modified Unscented Kalman Filter" without the model: the caller gets
//! [`Unscented::sigma_points`], predicts a measurement for each, and passes the [`Moments`] to [`Unscented::update`].
//! The filter has `N` states and `M` measurement channels, lives on the stack, and every call has a fixed cost. It is
//! safe in `f32`: weights are never negative, sums are taken about the central point, the covariance is reduced by a
//! product `U U^T` and cannot lose its symmetry, and variances have a floor and a ceiling relative to their initial
//! values.

mod settings;

use nalgebra::{SMatrix, SVector};

pub use settings::{Root, Settings, SettingsError};

use super::factor::{Cholesky, symmetric_root};
use crate::math::{Real, clamp};

/// Points at which the model is run: the state, and for each column of the root one point on either side of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SigmaPoints<T: Real, const N: usize> {
    /// The state itself, with weight W_0.
    pub centre: SVector<T, N>,
    /// The points on the positive side.
    pub plus: [SVector<T, N>; N],
    /// The points on the negative side.
    pub minus: [SVector<T, N>; N],
}

/// Mean and covariances of the sigma points and of their predictions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moments<T: Real, const N: usize, const M: usize> {
    /// Mean of the sigma points, X_k+1/k.
    pub state: SVector<T, N>,
    /// Covariance of the sigma points, without process noise.
    pub covariance: SMatrix<T, N, N>,
    /// Mean of the predictions, Zpred.
    pub prediction: SVector<T, M>,
    /// Covariance of the predictions, without measurement noise.
    pub prediction_covariance: SMatrix<T, M, M>,
    /// Cross covariance of points and predictions, C_xz.
    pub cross_covariance: SMatrix<T, N, M>,
}

/// Innovation of an update.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T: Real, const M: usize> {
    /// Measured minus predicted; zero in channels that are not used.
    pub innovation: SVector<T, M>,
    /// Covariance of the innovation, C_z, including measurement noise; one on the diagonal of channels that are not
    /// used.
    pub covariance: SMatrix<T, M, M>,
    /// Normalised innovation squared, summed over the channels used; its mean equals their number if model and noise
    /// match reality.
    pub normalised_square: T,
    /// Whether the update was applied to state and covariance.
    pub fused: bool,
    /// Whether the covariance had to be corrected to stay positive definite.
    pub repaired: bool,
}

/// State and covariance of a filter with `N` parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unscented<T: Real, const N: usize> {
    settings: Settings<T, N>,
    /// Distance of the sigma points from the state, as a factor on the columns of the root.
    spread: T,
    /// Weight of each point except the central one, W_i of paper eq. (sigpukf).
    pair_weight: T,
    state: SVector<T, N>,
    covariance: SMatrix<T, N, N>,
}

impl<T: Real, const N: usize> Unscented<T, N> {
    /// Creates a filter from its settings.
    ///
    /// # Errors
    /// Returns an error if the settings are unsafe to run, see [`SettingsError`].
    pub fn new(settings: Settings<T, N>) -> Result<Self, SettingsError> {
        settings.check()?;
        let pairs = T::one() - settings.central_weight;
        Ok(Self {
            spread: (T::of(count(N)) / pairs).root(),
            pair_weight: pairs / T::of(2.0 * count(N)),
            state: settings.state,
            covariance: SMatrix::from_diagonal(&settings.variance),
            settings,
        })
    }

    /// Returns the settings.
    pub fn settings(&self) -> &Settings<T, N> {
        &self.settings
    }

    /// Returns the state, X_k/k.
    pub fn state(&self) -> &SVector<T, N> {
        &self.state
    }

    /// Returns the covariance of the state, P_k/k.
    pub fn covariance(&self) -> &SMatrix<T, N, N> {
        &self.covariance
    }

    /// Distance of the sigma points from the state, as a factor on the columns of the root, paper eq. (sigpukf).
    pub fn spread(&self) -> T {
        self.spread
    }

    /// Computes the bounded sigma points, paper eqs. (sigpukf), (minmax), (movepukf).
    #[inline]
    pub fn sigma_points(&self) -> SigmaPoints<T, N> {
        let spread = self.spread;
        let root = match self.settings.root {
            Root::Symmetric => symmetric_root(&self.covariance),
            Root::Cholesky => *Cholesky::new(&self.covariance).lower(),
        };
        let mut points = SigmaPoints {
            centre: self.state,
            plus: [self.state; N],
            minus: [self.state; N],
        };
        for (j, (plus, minus)) in points.plus.iter_mut().zip(&mut points.minus).enumerate() {
            for k in 0..N {
                let offset = root[(k, j)] * spread;
                plus[k] = self.bounded(k, offset);
                minus[k] = self.bounded(k, -offset);
            }
        }
        points
    }

    /// Element `k` of a sigma point `offset` away from the state. Computed without branches, since most points are
    /// within the bounds.
    #[inline(always)]
    fn bounded(&self, k: usize, offset: T) -> T {
        let (low, high) = (self.settings.low[k], self.settings.high[k]);
        let centre = self.state[k];
        let point = centre + offset;
        let sits_on_bound_and_leaves =
            ((centre <= low) & (point < low)) | ((centre >= high) & (point > high));
        let point = if sits_on_bound_and_leaves {
            centre - self.settings.reflection * offset
        } else {
            point
        };
        clamp(point, low, high)
    }

    /// Computes the moments of sigma points and their predictions.
    ///
    /// `central` is the prediction of the central point; `plus` and `minus` are the differences of the other
    /// predictions from it, so that the caller, which knows the channels, can wrap angles.
    #[inline]
    pub fn moments<const M: usize>(
        &self,
        points: &SigmaPoints<T, N>,
        central: &SVector<T, M>,
        plus: &[SVector<T, M>; N],
        minus: &[SVector<T, M>; N],
    ) -> Moments<T, N, M> {
        let mut sums = Sums::zero();
        for (point, difference) in points.plus.iter().zip(plus) {
            sums.add(&(point - points.centre), difference);
        }
        for (point, difference) in points.minus.iter().zip(minus) {
            sums.add(&(point - points.centre), difference);
        }
        sums.moments(points, central, self.pair_weight)
    }

    /// Computes the moments for predictions that are linear in the state: `central` is the prediction of the state
    /// itself and `slope` (M x N) its derivative.
    #[inline]
    pub fn linear_moments<const M: usize>(
        &self,
        points: &SigmaPoints<T, N>,
        central: &SVector<T, M>,
        slope: &SMatrix<T, M, N>,
    ) -> Moments<T, N, M> {
        let mut sums = Sums::<T, N, 0>::zero();
        for point in points.plus.iter().chain(&points.minus) {
            sums.add(&(point - points.centre), &SVector::zeros());
        }
        let moments = sums.moments(points, &SVector::zeros(), self.pair_weight);
        let cross = slope * moments.covariance;
        Moments {
            state: moments.state,
            covariance: moments.covariance,
            prediction: central + slope * (moments.state - points.centre),
            prediction_covariance: cross * slope.transpose(),
            cross_covariance: cross.transpose(),
        }
    }

    /// Applies a measurement, paper "Update Step".
    ///
    /// `innovation` is the measurement minus `moments.prediction`; `noise` is the diagonal of R; channels that are not
    /// `used` have no effect. If any number is not finite, the filter is unchanged and `fused` is false.
    #[inline]
    pub fn update<const M: usize>(
        &mut self,
        moments: &Moments<T, N, M>,
        innovation: &SVector<T, M>,
        noise: &SVector<T, M>,
        used: &[bool; M],
    ) -> Innovation<T, M> {
        let mut innovation = *innovation;
        let mut covariance = moments.prediction_covariance;
        let mut cross = moments.cross_covariance;
        let mut any = false;
        for (k, &used) in used.iter().enumerate() {
            any |= used;
            if used {
                covariance[(k, k)] += noise[k];
                continue;
            }
            innovation[k] = T::zero();
            cross.set_column(k, &SVector::zeros());
            covariance.set_column(k, &SVector::zeros());
            covariance.set_row(k, &SVector::<T, M>::zeros().transpose());
            covariance[(k, k)] = T::one();
        }
        let factor = Cholesky::new(&covariance);
        let gain = factor.solve_transposed(&cross);
        let whitened = factor.solve_transposed(&innovation.transpose());
        let normalised_square = whitened.norm_squared();

        let moved = moments.state + gain * whitened.transpose();
        let mut next = moments.covariance - gain * gain.transpose();
        for k in 0..N {
            next[(k, k)] += self.settings.process_noise[k];
        }
        let repaired = self.settings.keep_positive(&mut next) || factor.repaired() > 0;
        let finite = moved.iter().all(|v| v.is_finite())
            && next.iter().all(|v| v.is_finite())
            && normalised_square.is_finite();
        let fused = finite && any;
        if fused {
            self.state = self.settings.limited(&moved);
            self.covariance = next;
        }
        Innovation {
            innovation,
            covariance,
            normalised_square,
            fused,
            repaired,
        }
    }

    /// Moves the state halfway back to its value before an update.
    pub fn hold_back(&mut self, before: &SVector<T, N>) {
        self.state = (self.state + before) * T::of(0.5);
    }

    /// Inflates the covariance by a factor, up to the initial variances.
    pub fn fade(&mut self, factor: T) {
        let scale = SVector::<T, N>::from_fn(|k, _| {
            let most = self.settings.variance[k] / self.covariance[(k, k)];
            let factor = if factor < most { factor } else { most };
            if factor > T::one() {
                factor.root()
            } else {
                T::one()
            }
        });
        for j in 0..N {
            for i in 0..N {
                self.covariance[(i, j)] *= scale[i] * scale[j];
            }
        }
    }
}

/// Weighted sums of the differences from the central point.
struct Sums<T: Real, const N: usize, const M: usize> {
    state: SVector<T, N>,
    prediction: SVector<T, M>,
    covariance: SMatrix<T, N, N>,
    prediction_covariance: SMatrix<T, M, M>,
    cross: SMatrix<T, N, M>,
}

impl<T: Real, const N: usize, const M: usize> Sums<T, N, M> {
    fn zero() -> Self {
        Self {
            state: SVector::zeros(),
            prediction: SVector::zeros(),
            covariance: SMatrix::zeros(),
            prediction_covariance: SMatrix::zeros(),
            cross: SMatrix::zeros(),
        }
    }

    #[inline(always)]
    fn add(&mut self, state: &SVector<T, N>, prediction: &SVector<T, M>) {
        self.state += state;
        self.prediction += prediction;
        // Whole columns are summed; half of the products are redundant, but they run in parallel.
        for j in 0..N {
            for i in 0..N {
                self.covariance[(i, j)] += state[i] * state[j];
            }
        }
        for j in 0..M {
            for i in 0..M {
                self.prediction_covariance[(i, j)] += prediction[i] * prediction[j];
            }
            for i in 0..N {
                self.cross[(i, j)] += state[i] * prediction[j];
            }
        }
    }

    /// `Sum W (x - mean)(x - mean)^T = Sum W d d^T - dm dm^T` with differences d from the centre: at most half of the
    /// sum is subtracted, so no digits are lost.
    #[inline]
    fn moments(
        &self,
        points: &SigmaPoints<T, N>,
        central: &SVector<T, M>,
        weight: T,
    ) -> Moments<T, N, M> {
        let (state, prediction) = (self.state * weight, self.prediction * weight);
        let mut moments = Moments {
            state: points.centre + state,
            prediction: central + prediction,
            covariance: SMatrix::zeros(),
            prediction_covariance: SMatrix::zeros(),
            cross_covariance: SMatrix::zeros(),
        };
        for j in 0..N {
            for i in j..N {
                let value = self.covariance[(i, j)] * weight - state[i] * state[j];
                moments.covariance[(i, j)] = value;
                moments.covariance[(j, i)] = value;
            }
        }
        for j in 0..M {
            for i in j..M {
                let value =
                    self.prediction_covariance[(i, j)] * weight - prediction[i] * prediction[j];
                moments.prediction_covariance[(i, j)] = value;
                moments.prediction_covariance[(j, i)] = value;
            }
            for i in 0..N {
                moments.cross_covariance[(i, j)] =
                    self.cross[(i, j)] * weight - state[i] * prediction[j];
            }
        }
        moments
    }
}

/// Converts a count to `f64`.
fn count(n: usize) -> f64 {
    // Numbers of states are small, so the conversion never saturates.
    f64::from(u32::try_from(n).unwrap_or(u32::MAX))
}
