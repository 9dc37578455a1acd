//! The residuals of points that a flight was simulated at: a search comes back to some of them, with other slopes or for
//! the error bars.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DVector;

use crate::jacobian::linearization_point::LinearizationPoint;

/// Number of points that are kept; each takes a tenth of a megabyte for 40 s of flight.
const KEPT: usize = 32;

/// Residuals of one flight, one for each stretch, at the last points.
#[derive(Debug, Default)]
pub(crate) struct KnownResiduals(Mutex<VecDeque<(LinearizationPoint, Arc<[DVector<f64>]>)>>);

impl KnownResiduals {
    /// Those at a point, simulated unless they are known. Returns `None` if they cannot be.
    pub(crate) fn at(
        &self,
        point: &LinearizationPoint,
        simulated: impl FnOnce() -> Option<Vec<DVector<f64>>>,
    ) -> Option<Arc<[DVector<f64>]>> {
        let known = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, residuals)) = known().iter().find(|(other, _)| other == point) {
            return Some(residuals.clone());
        }
        let residuals: Arc<[DVector<f64>]> = simulated()?.into();
        let mut known = known();
        known.truncate(KEPT - 1);
        known.push_front((point.clone(), residuals.clone()));
        Some(residuals)
    }
}

/// A copy of a flight may get another model, so it begins without any.
impl Clone for KnownResiduals {
    fn clone(&self) -> Self {
        Self::default()
    }
}
