//! The derivatives of a stretch as columns.

use nalgebra::{DMatrix, DVector};

/// The residual of a stretch and its derivatives.
#[derive(Debug, Clone)]
pub struct Jacobian {
    /// Residual: measured less simulated.
    pub residual: DVector<f64>,
    /// With respect to the start, by channel.
    pub start: DMatrix<f64>,
    /// With respect to the joints, by degree of the course over the stretch.
    pub joints: [DMatrix<f64>; 3],
    /// With respect to joint errors proportional to the bend.
    pub bend: DMatrix<f64>,
    /// With respect to scale and misalignment of the gyroscope.
    pub gyro: DMatrix<f64>,
    /// With respect to subject and sensors.
    pub subject: DMatrix<f64>,
    /// With respect to a force in each window, three axes each.
    pub force: DMatrix<f64>,
    /// With respect to a moment in each window.
    pub moment: DMatrix<f64>,
}

impl Jacobian {
    /// Whether no simulation diverged.
    pub(crate) fn is_finite(&self) -> bool {
        let finite = |matrix: &DMatrix<f64>| matrix.iter().all(|value| value.is_finite());
        let others = [
            &self.start,
            &self.bend,
            &self.subject,
            &self.force,
            &self.moment,
        ];
        self.residual.iter().all(|value| value.is_finite())
            && others.into_iter().chain(&self.joints).all(finite)
    }
}

/// The columns, unless a simulation diverged.
pub(crate) fn finite(columns: Vec<DMatrix<f64>>) -> Option<Vec<DMatrix<f64>>> {
    let mut values = columns.iter().flatten();
    values.all(|value| value.is_finite()).then_some(columns)
}
