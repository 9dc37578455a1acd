//! A flight weighted by the covariance of its errors, whatever its residuals are.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, Dyn};
use rayon::prelude::*;

use crate::jacobian::layout::Components;
use crate::jacobian::linearization_point::CONSTANTS;
use crate::likelihood::factor::{StretchFactor, WeightedStretch};
use crate::likelihood::gemm::{add_symmetric, mirror, product, square_of_triangle};

/// Number of stretches that are added up together, whatever the number of threads, so that sums do not depend on it.
pub(crate) const TOGETHER: usize = 4;

/// Stretches weighted with some variances.
pub(crate) struct WeighedFlight {
    sizes: Components,
    /// One for each stretch.
    pub(crate) stretches: Vec<WeightedStretch>,
    /// Information of the constants, without their prior.
    pub(crate) information: DMatrix<f64>,
}

impl WeighedFlight {
    /// Weights stretches with variances. Returns `None` if a covariance is not positive definite.
    pub(crate) fn new(parts: &[StretchFactor], sizes: &Components) -> Option<Arc<Self>> {
        let weighed = |parts: &[StretchFactor]| {
            // But for blocks below the diagonal.
            let mut information = DMatrix::zeros(CONSTANTS, CONSTANTS);
            let mut stretches = Vec::with_capacity(parts.len());
            for part in parts {
                let factor = part.covariance(sizes)?;
                let inverse = square_of_triangle(&inverse_triangle(&factor));
                let pulled = product(&inverse, &part.constants);
                add_symmetric(&part.constants, &pulled, &mut information);
                stretches.push(WeightedStretch {
                    ln_determinant: factor.ln_determinant(),
                    inverse,
                    pulled,
                });
            }
            Some((stretches, information))
        };
        let each: Option<Vec<_>> = parts.par_chunks(TOGETHER).map(weighed).collect();
        let mut information = DMatrix::zeros(CONSTANTS, CONSTANTS);
        let mut stretches = Vec::with_capacity(parts.len());
        for (of_share, share) in each? {
            information += share;
            stretches.extend(of_share);
        }
        mirror(&mut information);
        Some(Arc::new(Self {
            sizes: *sizes,
            stretches,
            information,
        }))
    }

    /// The same stretches, with the same slopes, weighted with other variances.
    pub(crate) fn with(
        self: &Arc<Self>,
        parts: &[StretchFactor],
        sizes: &Components,
    ) -> Option<Arc<Self>> {
        if self.sizes == *sizes {
            Some(self.clone())
        } else {
            Self::new(parts, sizes)
        }
    }
}

/// The inverse of the lower triangle of a factored matrix.
pub(crate) fn inverse_triangle(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let count = lower.nrows();
    let mut triangle = DMatrix::identity(count, count);
    for mut column in triangle.as_mut_slice().chunks_exact_mut(count) {
        let mut first = count - column.len();
        // A column of the inverse triangle is zero above the diagonal.
        while let Some((value, below)) = column.split_first_mut() {
            if *value != 0.0 {
                let pivots = &lower.as_slice()[first * count + first..(first + 1) * count];
                *value /= pivots[0];
                for (below, pivot) in below.iter_mut().zip(&pivots[1..]) {
                    *below -= *value * pivot;
                }
            }
            column = below;
            first += 1;
        }
    }
    triangle
}
