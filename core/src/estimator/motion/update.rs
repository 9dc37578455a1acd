//! Taking in a measurement, channel by channel.

use nalgebra::{SMatrix, SVector};

use super::measurement::Row;
use super::state::{Difference, STATES};
use crate::math::Real;

/// Least variance of an error coordinate.
const VARIANCE_FLOOR: f64 = 1e-12;

/// An innovation with its variance, noise included.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Innovation<T> {
    /// Measured less predicted.
    pub value: T,
    /// Its variance.
    pub variance: T,
}

/// What a channel says about a state that is `moved` from where the row was taken.
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

/// Keeps every variance above the floor; whether one was below.
pub fn keep_positive<T: Real>(covariance: &mut SMatrix<T, STATES, STATES>) -> bool {
    let floor = T::of(VARIANCE_FLOOR);
    let mut changed = false;
    for k in 0..STATES {
        // NaN is never above.
        let positive = covariance[(k, k)] > floor;
        if !positive {
            covariance[(k, k)] = floor;
            changed = true;
        }
    }
    changed
}

/// Takes the innovation into difference and covariance; `spread` is that of [`innovation`].
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
