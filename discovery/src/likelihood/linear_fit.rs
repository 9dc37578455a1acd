//! A flight as a linear problem with fitted errors.

use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

use crate::named_effect::EffectSet;
use nalgebra::DMatrix;
use rayon::prelude::*;

use crate::error::Result;
use crate::jacobian::layout::Components;
use crate::jacobian::linearization_point::{CONSTANTS, LinearizationPoint, OWN, StretchErrors};
use crate::jacobian::subject_error::GYRO;
use crate::likelihood::factor::StretchFactor;
use crate::likelihood::prior::Prior;
use crate::likelihood::schur::SchurComplement;
use crate::likelihood::variance_components::{FittedErrors, fit};
use crate::progress::{Progress, check};

/// Share of the limit of joint errors above which a fit has reached it.
const AT_LIMIT: f64 = 0.999;

/// Share above which joint errors may be something else that they have absorbed: in laboratory flights, fits of joints far
/// worse than a suit's end below three quarters, and those that lack an effect end above nine tenths.
const NEAR_LIMIT: f64 = 0.8;

/// Maximum number of steps of a fit without unknown forces and moments.
const STEPS_WITHOUT_WRENCH: usize = 12;

/// A problem with its errors fitted, given some effects.
pub struct LinearFit {
    /// The point of linearization: effects and constants.
    pub point: LinearizationPoint,
    /// The point at which the slopes were computed.
    pub(crate) slopes_at: Arc<LinearizationPoint>,
    /// One for each stretch.
    pub parts: Vec<StretchFactor>,
    /// The errors.
    pub errors: FittedErrors,
    pub(crate) whitened: SchurComplement,
    /// The reduced problem with columns for all effects, once it was asked for.
    pub(crate) all_effects: OnceLock<DMatrix<f64>>,
    /// Largest plausible joint error, constant or wandering (rad). Fitted errors do not exceed it.
    pub(crate) joint_limit: f64,
}

impl LinearFit {
    /// Whitened columns of every stretch, with the constants marginalized out.
    ///
    /// Returns `None` if a covariance is not positive definite.
    pub fn without_constants(&self, columns: &[DMatrix<f64>]) -> Option<Vec<DMatrix<f64>>> {
        let done = &self.errors.covariance * self.whitened.with_constants(columns);
        let each = self.parts.par_iter().zip(columns);
        each.map(|(part, columns)| {
            let mut left = columns - &*part.constants * &done;
            let factor = part.covariance(&self.errors.sizes)?;
            factor.l_dirty().solve_lower_triangular_mut(&mut left);
            Some(left)
        })
        .collect()
    }

    /// Whether the slopes were computed where the flight is linearized.
    pub(crate) fn has_own_slopes(&self) -> bool {
        *self.slopes_at == self.point
    }

    /// The point of linearization with the fitted constants and other effects.
    pub fn point_with(&self, effects: &EffectSet) -> LinearizationPoint {
        LinearizationPoint {
            effects: effects.clone(),
            stretches: self.likely_stretches(),
            ..self.errors.point(&self.point)
        }
    }

    /// Distance of the fitted constants from the point of linearization (standard errors, root mean square).
    pub(crate) fn moved(&self) -> f64 {
        let around = self.point.constants();
        let of = |k: usize| {
            let moved = self.errors.constants[k] - around[k];
            moved * moved / self.errors.covariance[(k, k)]
        };
        // The model is linear in the gyroscope's scale, so a change there needs no new linearization.
        let numbers = (0..OWN - GYRO).chain(OWN..CONSTANTS);
        let count = numbers.clone().count() as f64;
        (numbers.map(of).sum::<f64>() / count).sqrt()
    }

    /// The point of linearization with the most likely errors of each stretch.
    pub fn point_with_stretches(&self) -> LinearizationPoint {
        LinearizationPoint {
            stretches: self.likely_stretches(),
            ..self.point.clone()
        }
    }

    /// Whether the joints can plausibly have wandered this far. If not, the wander has absorbed some other error.
    fn is_plausible(&self) -> bool {
        self.errors.wander() < AT_LIMIT * self.joint_limit
    }

    /// Whether the joints would be off by nearly as much as their limit allows, constantly or wandering.
    pub(crate) fn is_beyond_suit(&self) -> bool {
        let largest = self
            .errors
            .wander()
            .max(self.errors.prior_deviations.calibration);
        largest > NEAR_LIMIT * self.joint_limit
    }

    /// Empty if the wander is not plausible: it would be linearized at an impossible posture.
    fn likely_stretches(&self) -> BTreeMap<usize, StretchErrors> {
        if self.is_plausible() {
            self.errors.of_stretches(&self.parts)
        } else {
            BTreeMap::new()
        }
    }

    /// The point of linearization from which a fit with other effects starts.
    pub fn start_with(&self, effects: &EffectSet) -> LinearizationPoint {
        let from = if self.is_plausible() {
            self.point.clone()
        } else {
            LinearizationPoint::files()
        };
        LinearizationPoint {
            effects: effects.clone(),
            ..from
        }
    }

    /// The errors, unless the wander is implausible.
    pub fn plausible_errors(&self) -> Option<&FittedErrors> {
        self.is_plausible().then_some(&self.errors)
    }

    /// The errors without unknown forces and moments. `prior` is that of the flight.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn without_wrench(
        &self,
        prior: &Prior,
        progress: &dyn Progress,
    ) -> Result<Option<FittedErrors>> {
        let prior = prior.given(&self.point.effects).without_wrench();
        let steps = STEPS_WITHOUT_WRENCH;
        let estimate = fit(&self.parts, &prior, Some(&self.errors), steps, progress);
        check(progress)?;
        Ok(estimate.map(|estimate| estimate.errors))
    }
}

/// Misfit of the model as given by the files, with sensor noise alone.
pub(crate) fn unadjusted(fitted: &[LinearFit]) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for fitted in fitted {
        let sensors = Components::from_fn(|k, _| {
            if k < 4 {
                fitted.errors.sizes[k]
            } else {
                1e-3 * fitted.errors.sizes[k].min(1e-6)
            }
        });
        for part in &fitted.parts {
            if let Some(factor) = part.covariance(&sensors) {
                sum += part.residual.dot(&factor.solve(&part.residual));
                count += part.residual.len() as f64;
            }
        }
    }
    sum / f64::max(count, 1.0)
}
