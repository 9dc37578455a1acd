//! A flight as a linear problem with its errors fitted.

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

/// A problem with its errors fitted, around some effects.
pub struct Fitted {
    /// Effects, and the constants around which the problem is linear.
    pub belief: Belief,
    /// By stretch.
    pub parts: Vec<Part>,
    /// The errors.
    pub errors: Errors,
    pub(super) whitened: Whitened,
    /// Wander beyond which the suit is no explanation (rad).
    pub(super) wander_limit: f64,
}

impl Fitted {
    /// All effects and what is missing, the last column, reduced.
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

    /// Columns of every stretch in deviations, less what constants do of them.
    ///
    /// None where the numbers of a stretch have no covariance.
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

    /// What the flight says of constants, with other effects.
    pub fn belief_with(&self, effects: &EffectSet) -> Belief {
        Belief {
            effects: effects.clone(),
            wander: self.likely_wander(),
            ..self.errors.belief(&self.belief)
        }
    }

    /// How far constants are from those around which this is linear (standard errors, root mean square).
    pub(super) fn moved(&self) -> f64 {
        let around = self.belief.constants();
        let of = |k: usize| {
            let moved = self.errors.constants[k] - around[k];
            moved * moved / self.errors.covariance[(k, k)]
        };
        // What the gyroscope does is linear.
        let numbers = (0..OWN - GYRO).chain(OWN..CONSTANTS);
        let count = numbers.clone().count() as f64;
        (numbers.map(of).sum::<f64>() / count).sqrt()
    }

    /// The same belief, with the likely wander.
    pub fn belief_wandering(&self) -> Belief {
        Belief {
            wander: self.likely_wander(),
            ..self.belief.clone()
        }
    }

    /// Whether joints can have wandered so far: where they cannot, they stand for something else.
    fn is_plausible(&self) -> bool {
        self.errors.wander() <= self.wander_limit
    }

    /// None where it is not plausible: slopes there are those of no body.
    fn likely_wander(&self) -> BTreeMap<usize, Course> {
        if self.is_plausible() {
            self.errors.likely_wander(&self.parts)
        } else {
            BTreeMap::new()
        }
    }

    /// Where a fit with other effects begins.
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

    /// The errors, unless they stand for something else.
    pub fn plausible_errors(&self) -> Option<&Errors> {
        self.is_plausible().then_some(&self.errors)
    }
}
