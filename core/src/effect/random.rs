//! Effects that change at random during a flight: their strength and correlation are known, but not their path.
//!
//! A model uses their mean. This module holds their strengths and correlations, from which the paths of simulated
//! flights are drawn and by which recorded flights are judged.

use nalgebra::{Matrix3, Vector3};

use crate::axis::AxisCoefficients;
use crate::math::Real;

/// Distance through the air over which the strength of turbulence is given (m): a skydiver falls this far in about 0.6
/// s.
pub const GUST_WAY: f64 = 30.0;

/// Correlation time of muscle input and damping (s).
///
/// Skydivers correct at 0.2 to 1 Hz. The strength estimated from a flight hardly depends on it, because the stretches
/// evaluated are shorter.
pub const INPUT_TIME: f64 = 2.0;

/// Strengths of the effects that change at random; zero means none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Random<T: Real> {
    /// Turbulence of the air.
    pub turbulence: Turbulence<T>,
    /// Standard deviations of the muscle input (dimensionless).
    pub muscle: AxisCoefficients<T>,
    /// Standard deviations of the factors on the damping, whose mean is one.
    pub damping: AxisCoefficients<T>,
}

impl<T: Real> Random<T> {
    /// Nothing changes at random.
    pub fn none() -> Self {
        Self {
            turbulence: Turbulence {
                strength: T::zero(),
                length: T::one(),
            },
            muscle: AxisCoefficients::zero(),
            damping: AxisCoefficients::zero(),
        }
    }
}

/// Standard deviations of the sum of two independent processes.
pub(super) fn together<T: Real>(
    one: AxisCoefficients<T>,
    other: AxisCoefficients<T>,
) -> AxisCoefficients<T> {
    one.zip_map(other, |one, other| (one * one + other * other).root())
}

/// Frozen isotropic turbulence with the spectrum of Dryden.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turbulence<T: Real> {
    /// Standard deviation of the velocity along each axis (m/s).
    pub strength: T,
    /// Integral length scale along the path (m).
    pub length: T,
}

impl<T: Real> Turbulence<T> {
    /// Creates turbulence from its gusts: `gust` is the standard deviation (m/s) of the change in the air's velocity
    /// along [`GUST_WAY`]. A short flight shows this quantity whatever the length scale `length` (m).
    pub fn from_gusts(gust: T, length: T) -> Self {
        let changed = (T::one() - decayed(T::of(GUST_WAY) / length)) * T::of(2.0);
        let strength = gust / changed.root();
        Self { strength, length }
    }

    /// Covariance (m2/s2) of the velocity of the air at two places `apart` from each other (m).
    ///
    /// Along the line between them it decays as `exp(-r / L)`, which is the spectrum of Dryden; across it the decay has
    /// the factor `1 - r / (2 L)`, as incompressibility requires (von Karman and Howarth 1938).
    pub fn covariance(&self, apart: &Vector3<T>) -> Matrix3<T> {
        let distance = apart.norm_squared().root();
        let lengths = distance / self.length;
        let along = decayed(lengths);
        let across = along * (T::one() - lengths * T::of(0.5));
        let variance = self.strength * self.strength;
        let same = Matrix3::identity() * across;
        if distance <= T::zero() {
            return same * variance;
        }
        let way = apart / distance;
        (same + way * way.transpose() * (along - across)) * variance
    }
}

/// Correlation of a first-order process after this number of correlation times.
pub fn decayed<T: Real>(times: T) -> T {
    T::of(core::f64::consts::E).power(-times)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gusts_are_the_change_over_their_distance() {
        for length in [20.0, 150.0, 1000.0] {
            let turbulence = Turbulence::from_gusts(1.2, length);
            let here = turbulence.covariance(&Vector3::zeros());
            let below = turbulence.covariance(&Vector3::new(0.0, 0.0, -GUST_WAY));
            let change = 2.0 * (here - below)[(2, 2)];
            assert!((change.sqrt() - 1.2).abs() < 1e-12, "{change}");
        }
    }

    #[test]
    fn turbulence_is_correlated_nearby_and_independent_far_away() {
        let turbulence = Turbulence {
            strength: 3.0,
            length: 100.0,
        };
        let here = turbulence.covariance(&Vector3::zeros());
        assert!((here - Matrix3::identity() * 9.0).norm() < 1e-12);
        let below = turbulence.covariance(&Vector3::new(0.0, 0.0, -100.0));
        let share = (-1.0_f64).exp();
        let expected = Matrix3::from_diagonal(&Vector3::new(0.5, 0.5, 1.0)) * (9.0 * share);
        assert!((below - expected).norm() < 1e-12, "{below}");
        assert!(turbulence.covariance(&Vector3::new(2e3, 1e3, 0.0)).norm() < 1e-6);
    }
}
