//! Measurement update, channel by channel.

use nalgebra::{SMatrix, SVector};

use super::measurement::Row;
use super::state::{Difference, STATES};
use crate::math::Real;

/// Lower bound of the variance of an error coordinate.
const VARIANCE_FLOOR: f64 = 1e-12;

/// An innovation with its variance, including measurement noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T> {
    /// Measured minus predicted.
    pub value: T,
    /// Variance of the innovation.
    pub variance: T,
}

/// Computes the innovation of a channel at a state that is `moved` from the one its row was computed for.
pub fn innovation<T: Real>(
    covariance: &SMatrix<T, STATES, STATES>,
    moved: &Difference<T>,
    row: &Row<T>,
    noise: T,
) -> (Innovation<T>, SVector<T, STATES>) {
    let mut spread = SVector::<T, STATES>::zeros();
    for k in 0..9 {
        let slope = row.slope[k];
        if slope != T::zero() {
            for i in 0..STATES {
                spread[i] += covariance[(i, k)] * slope;
            }
        }
    }
    let variance = row.along(&spread) + noise;
    let value = row.innovation - row.along(moved);
    (Innovation { value, variance }, spread)
}

/// Raises every variance to the lower bound; returns whether any was below it.
pub fn keep_positive<T: Real>(covariance: &mut SMatrix<T, STATES, STATES>) -> bool {
    let floor = T::of(VARIANCE_FLOOR);
    let mut changed = false;
    for k in 0..STATES {
        // The comparison is false for NaN.
        let positive = covariance[(k, k)] > floor;
        if !positive {
            covariance[(k, k)] = floor;
            changed = true;
        }
    }
    changed
}

/// Updates the difference `moved` and the covariance with an innovation; `spread` is the vector that [`innovation`]
/// returned.
pub fn take<T: Real>(
    covariance: &mut SMatrix<T, STATES, STATES>,
    moved: &mut Difference<T>,
    innovation: &Innovation<T>,
    spread: &SVector<T, STATES>,
) {
    let inverse = T::one() / innovation.variance;
    *moved += spread * (inverse * innovation.value);
    for j in 0..STATES {
        let factor = spread[j] * inverse;
        for i in 0..=j {
            let value = covariance[(i, j)] - spread[i] * factor;
            covariance[(i, j)] = value;
            covariance[(j, i)] = value;
        }
    }
}
