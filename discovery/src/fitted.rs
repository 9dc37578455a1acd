//! A flight as a linear problem with fitted errors.

use std::collections::BTreeMap;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::effect_set::EffectSet;
use super::error_model::Errors;
use super::error_prior::{CONSTANTS, OWN};
use super::linearization::{Belief, Course};
use super::nuisance::GYRO;
use super::part::Part;
use super::whitened::Whitened;

/// Share of the limit of joint errors above which a fit has reached it.
const AT_LIMIT: f64 = 0.999;

/// A problem with its errors fitted, given some effects.
pub struct Fitted {
    /// The point of linearization: effects and constants.
    pub belief: Belief,
    /// One for each stretch.
    pub parts: Vec<Part>,
    /// The errors.
    pub errors: Errors,
    pub(super) whitened: Whitened,
    /// Largest plausible joint error, constant or wandering (rad). Fitted errors do not exceed it.
    pub(super) joint_limit: f64,
}

impl Fitted {
    /// The reduced problem with columns for all effects, then the residual.
    pub fn all_effects(&self) -> DMatrix<f64> {
        let columns: Vec<DMatrix<f64>> = self
            .parts
            .par_iter()
            .map(|part| {
                let places = part.effects.ncols();
                let mut columns = part.effects.clone().insert_column(places, 0.0);
                columns.set_column(places, &part.missing);
                columns
            })
            .collect();
        self.whitened.reduced(&columns)
    }

    /// Whitened columns of every stretch, with the constants marginalized out.
    ///
    /// Returns `None` if a covariance is not positive definite.
    pub fn without_constants(&self, columns: &[DMatrix<f64>]) -> Option<Vec<DMatrix<f64>>> {
        let done = &self.errors.covariance * self.whitened.with_constants(columns);
        let each = self.parts.par_iter().zip(columns);
        each.map(|(part, columns)| {
            let mut left = columns - &part.constants * &done;
            let factor = part.covariance(&self.errors.sizes)?;
            factor.l_dirty().solve_lower_triangular_mut(&mut left);
            Some(left)
        })
        .collect()
    }

    /// The point of linearization with the fitted constants and other effects.
    pub fn belief_with(&self, effects: &EffectSet) -> Belief {
        Belief {
            effects: effects.clone(),
            wander: self.likely_wander(),
            ..self.errors.belief(&self.belief)
        }
    }

    /// Distance of the fitted constants from the point of linearization (standard errors, root mean square).
    pub(super) fn moved(&self) -> f64 {
        let around = self.belief.constants();
        let of = |k: usize| {
            let moved = self.errors.constants[k] - around[k];
            moved * moved / self.errors.covariance[(k, k)]
        };
        // The model is linear in the gyroscope's scale, so a change there needs no new linearization.
        let numbers = (0..OWN - GYRO).chain(OWN..CONSTANTS);
        let count = numbers.clone().count() as f64;
        (numbers.map(of).sum::<f64>() / count).sqrt()
    }

    /// The point of linearization with the most likely wander.
    pub fn belief_wandering(&self) -> Belief {
        Belief {
            wander: self.likely_wander(),
            ..self.belief.clone()
        }
    }

    /// Whether the joints can plausibly have wandered this far. If not, the wander has absorbed some other error.
    fn is_plausible(&self) -> bool {
        self.errors.wander() < AT_LIMIT * self.joint_limit
    }

    /// Whether the joints would be off by as much as their limit allows, constantly or wandering.
    pub(super) fn is_beyond_suit(&self) -> bool {
        !self.is_plausible() || self.errors.spread.calibration >= AT_LIMIT * self.joint_limit
    }

    /// Empty if the wander is not plausible: it would be linearized at an impossible posture.
    fn likely_wander(&self) -> BTreeMap<usize, Course> {
        if self.is_plausible() {
            self.errors.likely_wander(&self.parts)
        } else {
            BTreeMap::new()
        }
    }

    /// The point of linearization from which a fit with other effects starts.
    pub fn start_with(&self, effects: &EffectSet) -> Belief {
        let from = if self.is_plausible() {
            self.belief.clone()
        } else {
            Belief::files()
        };
        Belief {
            effects: effects.clone(),
            ..from
        }
    }

    /// The errors, unless the wander is implausible.
    pub fn plausible_errors(&self) -> Option<&Errors> {
        self.is_plausible().then_some(&self.errors)
    }
}
