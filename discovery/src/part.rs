//! A stretch as a linear problem with the covariance of its errors.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::error_prior::{COMPONENTS, CONSTANTS, Components};
use super::linearization::{Belief, Columns};
use super::product::product_transposed;
use super::stretch::{CHANNELS, NUMBERS, Stretch};
use super::varied::Varying;

/// Sensor group of each channel.
const GROUP: [usize; CHANNELS] = [0, 0, 0, 1, 1, 1, 2, 2, 3];

/// Residual and derivatives of a stretch, with everything that contributes to its covariance.
#[derive(Clone)]
pub struct Part {
    /// Residual at zero constants, to first order.
    pub missing: DVector<f64>,
    /// Derivatives with respect to the constants.
    pub constants: DMatrix<f64>,
    /// Derivatives with respect to the effects.
    pub effects: DMatrix<f64>,
    /// Derivatives with respect to a force and a moment in each window.
    pub pushes: [DMatrix<f64>; 2],
    /// Covariance of each component for a unit variance.
    kernels: Arc<[DMatrix<f64>]>,
    /// The effects that change at random, if the model has any.
    pub varying: Option<Arc<Varying>>,
    /// Weight of the stretch, less than one for outliers.
    pub weight: f64,
    /// First frame of the stretch.
    pub(super) first: usize,
    /// Derivatives with respect to the joints, by degree of their course.
    pub(super) joints: [DMatrix<f64>; 3],
    /// First-order effect of the wander at the point of linearization.
    pub wandered: DVector<f64>,
}

impl Part {
    /// Creates the problem from derivatives at a point of linearization.
    pub fn new(stretch: &Stretch, columns: Columns, belief: &Belief) -> Self {
        let mut kernels = Vec::with_capacity(COMPONENTS);
        let averaged = 1.0 / stretch.grid.window as f64;
        for group in 0..4 {
            let mut kernel = DMatrix::zeros(NUMBERS, NUMBERS);
            for channel in (0..CHANNELS).filter(|channel| GROUP[*channel] == group) {
                for row in (channel..NUMBERS).step_by(CHANNELS) {
                    kernel[(row, row)] += averaged;
                }
                // The simulation starts from a smoothed motion that shares noise with the measurement it is compared
                // to.
                let start = columns.start.column(channel);
                kernel += start * start.transpose() * stretch.start_variance;
                for row in 0..NUMBERS {
                    let both = start[row] * stretch.start_covariance;
                    kernel[(row, channel)] -= both;
                    kernel[(channel, row)] -= both;
                }
            }
            kernels.push(kernel);
        }
        let square = |matrix: &DMatrix<f64>| product_transposed(matrix, matrix);
        kernels.extend(columns.joints.iter().map(square));
        kernels.extend([&columns.moment, &columns.force].map(square));
        let mut constants = DMatrix::zeros(NUMBERS, CONSTANTS);
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
        let part = Self {
            missing: DVector::zeros(NUMBERS),
            constants,
            effects: columns.effects,
            pushes: [columns.force, columns.moment],
            kernels: kernels.into(),
            varying: None,
            weight: 1.0,
            first: stretch.first,
            joints: columns.joints,
            wandered: DVector::zeros(NUMBERS),
        };
        part.around(&columns.missing, belief)
    }

    /// The same derivatives at another point of linearization, with the residual found there.
    pub fn around(mut self, missing: &DVector<f64>, belief: &Belief) -> Self {
        self.wandered.fill(0.0);
        if let Some(wander) = belief.wander.get(&self.first) {
            for (columns, wander) in self.joints.iter().zip(wander) {
                self.wandered += columns * wander;
            }
        }
        self.missing = missing + &self.constants * belief.constants() + &self.wandered;
        self
    }

    /// The components that this stretch has, with their covariance for a unit variance.
    pub(super) fn kernels(&self) -> impl Iterator<Item = (usize, &DMatrix<f64>)> {
        let varying = self.varying.iter().flat_map(|varying| &varying.kernels);
        let varying = varying.map(|(k, kernel)| (*k, kernel));
        self.kernels.iter().enumerate().chain(varying)
    }

    /// The factored covariance.
    pub fn covariance(&self, sizes: &Components) -> Option<Cholesky<f64, Dyn>> {
        let mut covariance = DMatrix::zeros(NUMBERS, NUMBERS);
        for (k, kernel) in self.kernels() {
            covariance += kernel * (sizes[k] / self.weight);
        }
        covariance.cholesky()
    }
}
