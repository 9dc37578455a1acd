//! The residuals of points that a flight was simulated at: a search comes back to some of them, with other slopes or for
//! the error bars.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::DVector;

use crate::jacobian::linearization_point::LinearizationPoint;

/// Number of points that are kept; each takes a tenth of a megabyte for 40 s of flight.
const KEPT: usize = 32;

/// Residuals at a point, one for each stretch.
type Known = (LinearizationPoint, Arc<[DVector<f64>]>);

/// Residuals of one flight at the last points.
#[derive(Debug, Default)]
pub(crate) struct KnownResiduals(Mutex<VecDeque<Known>>);

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

#[cfg(test)]
mod tests {
    use super::*;
    use bodyflight_core::effect::Effect;

    #[test]
    fn a_known_point_is_not_simulated_again_until_others_displace_it() {
        let known = KnownResiduals::default();
        let at = |mass: f64| LinearizationPoint {
            effects: vec![(Effect::Mass, [mass, 0.0, 0.0])],
            ..LinearizationPoint::files()
        };
        let found = |mass: f64, simulated: f64| {
            let residuals = known.at(&at(mass), || {
                Some(vec![DVector::from_element(1, simulated)])
            });
            residuals.unwrap()[0][0].to_bits()
        };
        assert_eq!(found(1.0, 10.0), 10_f64.to_bits());
        assert_eq!(found(1.0, 11.0), 10_f64.to_bits());
        assert!(known.at(&at(2.0), || None).is_none());
        assert_eq!(found(2.0, 20.0), 20_f64.to_bits());
        let others = (0..KEPT).map(|k| 3.0 + k as f64);
        others.for_each(|mass| assert_eq!(found(mass, mass), mass.to_bits()));
        assert_eq!(found(1.0, 12.0), 12_f64.to_bits());
    }
}
