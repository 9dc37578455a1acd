//! A flight as a linear problem: fits its errors, and reduces columns by marginalizing the constants.

use std::sync::Arc;

use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::effect::Model;
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::effect_set::{EffectSet, ParameterId, all_parameters};
use super::error::Result;
use super::error_model::{self, Errors};
use super::error_prior::Prior;
use super::fitted::Fitted;
use super::linearization::{Belief, Columns, effects_alone, effects_and_missing, missing};
use super::nuisance::{Tolerances, twins};
use super::part::Part;
use super::progress::{Progress, check};
use super::recorded_noise::recorded_noise;
use super::stretch::{NUMBERS, Stretch, stretches};
use super::track::Track;
use super::varied::{Varying, random};
use super::whitened::Whitened;
use super::window::components;

/// Maximum number of steps in a fit of the errors: from the prior, and from a similar fit.
const FIRST_STEPS: usize = 20;
const STEPS: usize = 8;
/// The same if the slopes of another fit are reused: several such fits follow one another.
const FURTHER_STEPS: usize = 3;

/// Squared residuals per observation above which a stretch loses weight, since no distribution of errors produces them.
const OUTLYING: f64 = 3.0;

/// Maximum number of fits with fixed slopes until the constants converge, the step at which they have converged
/// (standard errors, root mean square), and the ratio of successive steps above which the iteration is stopped.
const SETTLING: usize = 8;
const SETTLED: f64 = 0.1;
const STAGNANT: f64 = 0.8;

/// Maximum number of times slopes are recomputed.
const SLOPES: usize = 6;

/// Gain from recomputed slopes above which they are recomputed once more.
pub(super) const AGAIN: f64 = 20.0;

/// A flight to be explained.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The flight.
    pub track: &'a Track,
    /// The model as given by the files.
    pub plain: Model<f64>,
    /// The stretches that are simulated.
    pub stretches: Vec<Stretch>,
    /// Noise of single frames, estimated from the recording.
    pub noise: [f64; 4],
    /// Prior of the errors.
    pub prior: Prior,
    /// Weight of each stretch.
    weights: Vec<f64>,
}

impl<'a> Problem<'a> {
    /// Estimates the sensor noise and cuts the flight into stretches.
    pub fn new(track: &'a Track, tolerances: &Tolerances) -> Self {
        let plain = Model::new(track.dynamics, track.start_height());
        let noise = recorded_noise(track);
        let stretches = stretches(track, noise[1]);
        Self {
            track,
            plain,
            weights: vec![1.0; stretches.len()],
            stretches,
            noise,
            prior: Prior::new(&noise, tolerances),
        }
    }

    fn linearized(
        &self,
        belief: &Belief,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Result<Option<Vec<Part>>> {
        let parts: Option<Vec<Part>> = self
            .stretches
            .par_iter()
            .zip(&self.weights)
            .map(|(stretch, weight)| {
                check(progress).ok()?;
                let columns = Columns::new(self.track, stretch, &self.plain, belief, parameters)?;
                let mut part = Part::new(stretch, columns, belief);
                part.weight = *weight;
                let random = random(&belief.effects);
                let varying = Varying::new(self.track, stretch, &self.plain, belief, &random);
                part.varying = varying.map(Arc::new);
                Some(part)
            })
            .collect();
        check(progress)?;
        Ok(parts)
    }

    /// Drops stretches in which the simulation diverges.
    pub fn without_stretches_beyond_numbers(&mut self, belief: &Belief) {
        let flies = |stretch: &Stretch| {
            effects_and_missing(self.track, stretch, &self.plain, belief, &[])
                .iter()
                .all(|value| value.is_finite())
        };
        self.stretches.retain(flies);
        self.weights = vec![1.0; self.stretches.len()];
    }

    /// The prior given some effects: constants that would do the same are held fixed.
    pub fn prior_with(&self, effects: &EffectSet) -> Prior {
        let mut prior = self.prior.clone();
        prior.held = effects
            .iter()
            .flat_map(|(effect, _)| twins(*effect))
            .collect();
        for (effect, values) in effects {
            for (k, value) in components(*effect).zip(values) {
                prior.sizes[k] = (2.0 * value.ln(), 0.0);
            }
        }
        prior
    }

    /// Fits the errors, relinearizing `rounds` times, starting from `errors` if given. Returns `None` if the simulation
    /// diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn fit(
        &self,
        belief: &Belief,
        errors: Option<&Errors>,
        rounds: usize,
        progress: &dyn Progress,
    ) -> Result<Option<Fitted>> {
        let mut belief = belief.clone();
        for k in self.prior_with(&belief.effects).held {
            belief.subject.0[k] = 0.0;
        }
        let parameters = all_parameters();
        let mut errors = errors.cloned();
        let mut found = None;
        for _ in 0..rounds {
            let Some(parts) = self.linearized(&belief, &parameters, progress)? else {
                return Ok(None);
            };
            let steps = if errors.is_some() { STEPS } else { FIRST_STEPS };
            let Some(fitted) = self.fitted(parts, belief, errors.as_ref(), steps, progress)? else {
                return Ok(None);
            };
            errors = Some(fitted.errors.clone());
            belief = fitted.belief_with(&fitted.belief.effects);
            found = Some(fitted);
        }
        Ok(found)
    }

    /// Fits the errors of the model as given by the files, without any effect. Returns `None` if the simulation
    /// diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn first(&self, progress: &dyn Progress) -> Result<Option<Fitted>> {
        let belief = Belief::files();
        match self.linearized(&belief, &[], progress)? {
            Some(parts) => self.fitted(parts, belief, None, FIRST_STEPS, progress),
            None => Ok(None),
        }
    }

    /// Fits the errors around another point, reusing the slopes of a fit. Only the residual is simulated again, which
    /// is far cheaper than recomputing all slopes. Returns `None` if the simulation diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn fit_with_slopes_of(
        &self,
        fitted: &Fitted,
        belief: &Belief,
        progress: &dyn Progress,
    ) -> Result<Option<Fitted>> {
        let mut belief = belief.clone();
        for k in self.prior_with(&belief.effects).held {
            belief.subject.0[k] = 0.0;
        }
        let parts: Option<Vec<Part>> = self
            .stretches
            .par_iter()
            .zip(&fitted.parts)
            .map(|(stretch, part)| {
                check(progress).ok()?;
                let missing = missing(self.track, stretch, &self.plain, &belief);
                let finite = missing.iter().all(|value| value.is_finite());
                finite.then(|| part.clone().around(&missing, &belief))
            })
            .collect();
        check(progress)?;
        match parts {
            Some(parts) => {
                let errors = Some(&fitted.errors);
                self.fitted(parts, belief, errors, FURTHER_STEPS, progress)
            }
            None => Ok(None),
        }
    }

    /// Repeats the fit around the constants it found until they converge, because likelihoods at other points of
    /// linearization cannot be compared.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn settled(&self, fitted: Fitted, progress: &dyn Progress) -> Result<Fitted> {
        let mut moved = fitted.moved();
        let mut best = fitted;
        for _ in 0..SETTLING {
            if moved < SETTLED {
                break;
            }
            let belief = best.belief_with(&best.belief.effects);
            let Some(next) = self.fit_with_slopes_of(&best, &belief, progress)? else {
                break;
            };
            let before = moved;
            (moved, best) = (next.moved(), next);
            if moved > STAGNANT * before {
                break;
            }
        }
        Ok(best)
    }

    /// Repeats the fit with recomputed slopes while the flight gains from it: any effect would seem to explain what a
    /// fit that has not converged leaves.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn converged(&self, fitted: Fitted, progress: &dyn Progress) -> Result<Fitted> {
        let mut best = self.settled(fitted, progress)?;
        for _ in 0..SLOPES {
            let belief = best.belief_with(&best.belief.effects);
            let Some(next) = self.fit(&belief, Some(&best.errors), 1, progress)? else {
                break;
            };
            let next = self.settled(next, progress)?;
            let gained = next.errors.likelihood - best.errors.likelihood;
            if gained > 0.0 {
                best = next;
            }
            if gained < AGAIN {
                break;
            }
        }
        Ok(best)
    }

    fn fitted(
        &self,
        parts: Vec<Part>,
        belief: Belief,
        errors: Option<&Errors>,
        steps: usize,
        progress: &dyn Progress,
    ) -> Result<Option<Fitted>> {
        let prior = self.prior_with(&belief.effects);
        let estimate = error_model::fit(&parts, &prior, errors, steps, progress);
        check(progress)?;
        let Some(estimate) = estimate else {
            return Ok(None);
        };
        let spread = estimate.errors.spread;
        let whitened = Whitened::new(estimate.weighed, &estimate.information, &spread, &prior);
        Ok(whitened.map(|whitened| Fitted {
            belief,
            parts,
            errors: estimate.errors,
            whitened,
            joint_limit: prior.tolerances.joint_limit(),
        }))
    }

    /// Reduces the weight of outlying stretches.
    pub fn weigh(&mut self, fitted: &Fitted) {
        for (weight, square) in self.weights.iter_mut().zip(&fitted.errors.squares) {
            *weight = (*weight * OUTLYING * NUMBERS as f64 / square).min(1.0);
        }
    }

    /// The residual and the derivatives with respect to some parameters, around effects that may differ from those of
    /// the fit, reduced by the fit.
    ///
    /// The constants stay those of the fit. Returns `None` if the simulation diverges or the search was cancelled.
    pub fn around(
        &self,
        fitted: &Fitted,
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<DMatrix<f64>> {
        let columns = self.columns_around(fitted, effects, parameters, progress)?;
        Some(fitted.whitened.reduced(&columns))
    }

    /// The same at the fit's own point of linearization, where the residual is known.
    pub fn slopes_here(
        &self,
        fitted: &Fitted,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<DMatrix<f64>> {
        let columns: Option<Vec<DMatrix<f64>>> = self
            .stretches
            .par_iter()
            .zip(&fitted.parts)
            .map(|(stretch, part)| {
                check(progress).ok()?;
                let (track, belief) = (self.track, &fitted.belief);
                let slopes = effects_alone(track, stretch, &self.plain, belief, parameters);
                let mut columns = slopes.insert_column(parameters.len(), 0.0);
                columns.set_column(parameters.len(), &part.missing);
                let finite = columns.iter().all(|value| value.is_finite());
                finite.then_some(columns)
            })
            .collect();
        Some(fitted.whitened.reduced(&columns?))
    }

    /// The same for each stretch, before the reduction.
    pub fn columns_around(
        &self,
        fitted: &Fitted,
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<Vec<DMatrix<f64>>> {
        let mut belief = Belief {
            effects: effects.clone(),
            ..fitted.belief.clone()
        };
        for k in self.prior_with(effects).held {
            belief.subject.0[k] = 0.0;
        }
        self.columns_of(fitted, &belief, |stretch| {
            check(progress).ok()?;
            let track = self.track;
            let columns = effects_and_missing(track, stretch, &self.plain, &belief, parameters);
            Some(columns)
        })
    }

    /// The same flight under loads of the description grammar.
    #[must_use]
    pub fn under(&self, loads: &AppliedLoads<f64>) -> Self {
        let mut other = self.clone();
        other.plain.applied = *loads;
        other
    }

    /// Columns of every stretch around a point, the last being the residual, reduced by a fit. Returns `None` if the
    /// simulation diverges or `columns` returns `None`.
    pub fn reduced_around(
        &self,
        fitted: &Fitted,
        belief: &Belief,
        columns: impl Fn(&Stretch) -> Option<DMatrix<f64>> + Sync,
    ) -> Option<DMatrix<f64>> {
        let columns = self.columns_of(fitted, belief, columns)?;
        Some(fitted.whitened.reduced(&columns))
    }

    fn columns_of(
        &self,
        fitted: &Fitted,
        belief: &Belief,
        columns: impl Fn(&Stretch) -> Option<DMatrix<f64>> + Sync,
    ) -> Option<Vec<DMatrix<f64>>> {
        let around = belief.constants();
        self.stretches
            .par_iter()
            .zip(&fitted.parts)
            .map(|(stretch, part)| {
                let mut columns = columns(stretch)?;
                let last = columns.ncols() - 1;
                let mut missing = columns.column_mut(last);
                missing += &part.constants * &around + &part.wandered;
                let finite = columns.iter().all(|value| value.is_finite());
                finite.then_some(columns)
            })
            .collect()
    }
}
