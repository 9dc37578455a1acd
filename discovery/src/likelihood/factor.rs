//! A stretch as a linear problem with the covariance of its errors, and a flight weighted by them.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::jacobian::columns::Jacobian;
use crate::jacobian::layout::{COMPONENTS, Components, WANDER};
use crate::jacobian::linearization_point::{CONSTANTS, LinearizationPoint, StretchErrors};
use crate::jacobian::random_effects::RandomEffectColumns;
use crate::jacobian::symmetric::Symmetric;
use crate::likelihood::gemm::{
    add_symmetric, mirror, product, product_transposed, square, square_of_triangle,
};
use crate::shooting::joint_error::Angles;
use crate::shooting::stretch::{CHANNELS, Channels, Stretch};

/// Sensor group of each channel.
const GROUP: [usize; CHANNELS] = [0, 0, 0, 1, 1, 1, 2, 2, 3];

/// Number of stretches that are added up together, whatever the number of threads, so that sums do not depend on it.
pub(crate) const TOGETHER: usize = 4;

/// Residual and derivatives of a stretch, with everything that contributes to its covariance. Fits with the same slopes
/// share them.
#[derive(Clone)]
pub struct StretchFactor {
    /// Residual at zero constants, to first order.
    pub residual: DVector<f64>,
    /// Derivatives with respect to the constants.
    pub constants: Arc<DMatrix<f64>>,
    /// Derivatives with respect to a force and a moment in each window.
    pub pushes: Arc<[DMatrix<f64>; 2]>,
    /// Covariance of each component for a unit variance.
    kernels: Arc<[Symmetric]>,
    /// The effects that change at random, if the model has any.
    pub varying: Option<Arc<RandomEffectColumns>>,
    /// Weight of the stretch, less than one for outliers.
    pub weight: f64,
    /// First frame of the stretch.
    pub(crate) first: usize,
    /// Derivatives with respect to the joints, by degree of their course.
    pub(crate) joints: Arc<[DMatrix<f64>; 3]>,
    /// Derivatives with respect to the start, and its variance and its covariance with the first comparison for unit
    /// variance of a frame.
    start: DMatrix<f64>,
    start_noise: [f64; 2],
    /// Variance of the start beyond its noise, and what it adds to the covariance.
    free_start: Channels,
    of_free_start: Arc<Symmetric>,
    /// First-order effect of the wander and the start at the point of linearization.
    pub wandered: DVector<f64>,
}

impl StretchFactor {
    /// Creates the problem from derivatives at a point of linearization.
    pub fn new(stretch: &Stretch, columns: Jacobian, point: &LinearizationPoint) -> Self {
        let residuals = columns.residual.len();
        let mut kernels = Vec::with_capacity(COMPONENTS);
        let averaged = 1.0 / stretch.grid.window as f64;
        for group in 0..4 {
            let mut kernel = DMatrix::zeros(residuals, residuals);
            for channel in (0..CHANNELS).filter(|channel| GROUP[*channel] == group) {
                for row in (channel..residuals).step_by(CHANNELS) {
                    kernel[(row, row)] += averaged;
                }
                // The simulation starts from a smoothed motion that shares noise with the measurement it is compared
                // to.
                let start = columns.start.column(channel);
                kernel += start * start.transpose() * stretch.start_variance;
                for row in 0..residuals {
                    let both = start[row] * stretch.start_covariance;
                    kernel[(row, channel)] -= both;
                    kernel[(channel, row)] -= both;
                }
            }
            kernels.push(Symmetric::of(&kernel));
        }
        let square = |matrix: &DMatrix<f64>| Symmetric::of(&square(matrix));
        kernels.extend(columns.joints.iter().map(square));
        kernels.extend([&columns.moment, &columns.force].map(square));
        let mut constants = DMatrix::zeros(residuals, CONSTANTS);
        let groups = [
            &columns.joints[0],
            &columns.bend,
            &columns.gyro,
            &columns.subject,
        ];
        let mut first = 0;
        for group in groups {
            constants.columns_mut(first, group.ncols()).copy_from(group);
            first += group.ncols();
        }
        let free_start = stretch.free_start;
        let mut scaled = columns.start.clone();
        for (mut column, variance) in scaled.column_iter_mut().zip(&free_start) {
            column *= *variance;
        }
        let part = Self {
            residual: DVector::zeros(residuals),
            constants: Arc::new(constants),
            pushes: Arc::new([columns.force, columns.moment]),
            kernels: kernels.into(),
            varying: None,
            weight: 1.0,
            first: stretch.first,
            joints: Arc::new(columns.joints),
            free_start,
            of_free_start: Symmetric::of(&product_transposed(&scaled, &columns.start)).into(),
            start: columns.start,
            start_noise: [stretch.start_variance, stretch.start_covariance],
            wandered: DVector::zeros(residuals),
        };
        part.around(&columns.residual, point)
    }

    /// The same derivatives at another point of linearization, with the residual found there.
    pub fn around(mut self, residual: &DVector<f64>, point: &LinearizationPoint) -> Self {
        self.wandered.fill(0.0);
        if let Some(errors) = point.stretches.get(&self.first) {
            for (columns, wander) in self.joints.iter().zip(&errors.wander) {
                self.wandered += columns * wander;
            }
            self.wandered += &self.start * errors.start;
        }
        self.residual = residual + &*self.constants * point.constants() + &self.wandered;
        self
    }

    /// The components that this stretch has, with their covariance for a unit variance.
    pub(crate) fn kernels(&self) -> impl Iterator<Item = (usize, &Symmetric)> {
        let varying = self.varying.iter().flat_map(|varying| &varying.kernels);
        let varying = varying.map(|(k, kernel)| (*k, kernel));
        self.kernels.iter().enumerate().chain(varying)
    }

    /// The most likely errors, given variance components and the residual, multiplied by the inverse of its covariance,
    /// that the constants leave.
    pub(crate) fn likely(&self, sizes: &Components, pulled: &DVector<f64>) -> StretchErrors {
        let mut wander = [Angles::zeros(); 3];
        for ((angles, columns), k) in wander.iter_mut().zip(&*self.joints).zip(WANDER) {
            angles.copy_from(&(columns.tr_mul(pulled) * sizes[k]));
        }
        let [variance, covariance] = self.start_noise;
        let seen = self.start.tr_mul(pulled);
        let start = Channels::from_fn(|channel, _| {
            sizes[GROUP[channel]] * (variance * seen[channel] - covariance * pulled[channel])
                + self.free_start[channel] * seen[channel]
        });
        StretchErrors { wander, start }
    }

    /// The factored covariance.
    pub fn covariance(&self, sizes: &Components) -> Option<Cholesky<f64, Dyn>> {
        let mut covariance = Symmetric::zeros(self.residual.len());
        covariance.add(&self.of_free_start, 1.0 / self.weight);
        for (k, kernel) in self.kernels() {
            covariance.add(kernel, sizes[k] / self.weight);
        }
        // The factor needs only the lower triangle.
        covariance.triangle().cholesky()
    }
}

/// A stretch weighted by the errors of its flight.
pub(crate) struct WeightedStretch {
    /// Inverse of the covariance.
    pub(crate) inverse: DMatrix<f64>,
    /// The columns of the constants, multiplied by the inverse.
    pub(crate) pulled: DMatrix<f64>,
    /// Logarithm of the determinant of the covariance.
    pub(crate) ln_determinant: f64,
}

/// A flight weighted by some variances of its errors, whatever its residuals are.
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
