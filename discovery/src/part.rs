//! A stretch as a linear problem with the covariance of its errors.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::error_prior::{COMPONENTS, CONSTANTS, Components};
use super::linearization::{Belief, Columns};
use super::product::product_transposed;
use super::stretch::{CHANNELS, NUMBERS, Stretch};

/// Groups of sensors, by channel.
const GROUP: [usize; CHANNELS] = [0, 0, 0, 1, 1, 1, 2, 2, 3];

/// Numbers of a stretch with all of which they are made.
#[derive(Clone)]
pub struct Part {
    /// Residual at zero constants, to first order.
    pub missing: DVector<f64>,
    /// Constants.
    pub constants: DMatrix<f64>,
    /// Effects.
    pub effects: DMatrix<f64>,
    /// Derivatives by a force and a moment in each window.
    pub pushes: [DMatrix<f64>; 2],
    /// Covariance of each component at a size of one.
    pub(super) kernels: Arc<[DMatrix<f64>]>,
    /// Share of its weight that a stretch keeps.
    pub weight: f64,
    /// First frame of the stretch.
    pub(super) first: usize,
    /// The joints, by degree of their course.
    pub(super) joints: [DMatrix<f64>; 3],
    /// What the wander changes around which this is linear.
    pub wandered: DVector<f64>,
}

impl Part {
    /// Of columns around a belief.
    pub fn new(stretch: &Stretch, columns: Columns, belief: &Belief) -> Self {
        let mut kernels = Vec::with_capacity(COMPONENTS);
        let averaged = 1.0 / stretch.grid.window as f64;
        for group in 0..4 {
            let mut kernel = DMatrix::zeros(NUMBERS, NUMBERS);
            for channel in (0..CHANNELS).filter(|channel| GROUP[*channel] == group) {
                for row in (channel..NUMBERS).step_by(CHANNELS) {
                    kernel[(row, row)] += averaged;
                }
                // The measurement less the flight from a start that has a part of the same noise.
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
            weight: 1.0,
            first: stretch.first,
            joints: columns.joints,
            wandered: DVector::zeros(NUMBERS),
        };
        part.around(&columns.missing, belief)
    }

    /// The same slopes around another belief, where so much is missing.
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

    /// The covariance factored.
    pub fn covariance(&self, sizes: &Components) -> Option<Cholesky<f64, Dyn>> {
        let mut covariance = DMatrix::zeros(NUMBERS, NUMBERS);
        for (kernel, size) in self.kernels.iter().zip(sizes) {
            covariance += kernel * (*size / self.weight);
        }
        covariance.cholesky()
    }
}
