//! A flight as a linear problem with its errors fitted, and what columns of it come to once constants are taken out.

use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::effect::Model;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::effect_set::{EffectSet, ParameterId, all_parameters};
use super::error::Result;
use super::error_model::{self, CONSTANTS, Errors, OWN, Part};
use super::error_prior::Prior;
use super::linearization::{Belief, Columns, effects_and_missing};
use super::nuisance::{SUBJECT, Tolerances, twins};
use super::product::transposed_product;
use super::progress::{Progress, check};
use super::recorded_noise::recorded_noise;
use super::stretch::{NUMBERS, Stretch, stretches};
use super::track::Track;

/// Steps of a fit of the errors: from nothing, and from a fit that is near.
const FIRST_STEPS: usize = 20;
const STEPS: usize = 8;

/// Squares of a stretch by its numbers from which on it loses weight: what no distribution of errors makes.
const OUTLYING: f64 = 3.0;

/// A flight to be explained.
#[derive(Clone)]
pub struct Problem<'a> {
    /// The flight.
    pub track: &'a Track,
    /// The model as the files describe it.
    pub plain: Model<f64>,
    /// Where the model flies by itself.
    pub stretches: Vec<Stretch>,
    /// Noise of single frames as recorded.
    pub noise: [f64; 4],
    /// What is believed of errors.
    pub prior: Prior,
    /// Of each stretch.
    weights: Vec<f64>,
}

/// A problem with its errors fitted, around some effects.
pub struct Fitted {
    /// Effects, and the constants around which the problem is linear.
    pub belief: Belief,
    /// By stretch.
    pub parts: Vec<Part>,
    /// The errors.
    pub errors: Errors,
    whitened: Whitened,
}

impl<'a> Problem<'a> {
    /// Reads the noise of the sensors, and finds the stretches that have numbers.
    pub fn new(track: &'a Track, tolerances: &Tolerances) -> Self {
        let plain = Model::new(track.dynamics, track.start_height());
        let noise = recorded_noise(track);
        let stretches = stretches(track);
        Self {
            track,
            plain,
            weights: vec![1.0; stretches.len()],
            stretches,
            noise,
            prior: Prior::new(&noise, tolerances),
        }
    }

    fn linearized(&self, belief: &Belief, progress: &dyn Progress) -> Result<Option<Vec<Part>>> {
        let parameters = all_parameters();
        let parts: Option<Vec<Part>> = self
            .stretches
            .par_iter()
            .zip(&self.weights)
            .map(|(stretch, weight)| {
                check(progress).ok()?;
                let columns = Columns::new(self.track, stretch, &self.plain, belief, &parameters)?;
                let mut part = Part::new(stretch, columns, belief);
                part.weight = *weight;
                Some(part)
            })
            .collect();
        check(progress)?;
        Ok(parts)
    }

    /// Leaves out stretches that a belief cannot fly.
    pub fn without_stretches_beyond_numbers(&mut self, belief: &Belief) {
        let flies = |stretch: &Stretch| {
            effects_and_missing(self.track, stretch, &self.plain, belief, &[])
                .iter()
                .all(|value| value.is_finite())
        };
        self.stretches.retain(flies);
        self.weights = vec![1.0; self.stretches.len()];
    }

    /// What belief of errors goes with effects: constants that do the same are held.
    pub fn prior_with(&self, effects: &EffectSet) -> Prior {
        let mut prior = self.prior.clone();
        prior.held = effects
            .iter()
            .flat_map(|(effect, _)| twins(*effect))
            .collect();
        prior
    }

    /// Fits the errors around a belief, in so many linear problems one after another, from the errors of another fit if
    /// there is one. None where the model has no numbers.
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
        let prior = self.prior_with(&belief.effects);
        let mut belief = belief.clone();
        for k in &prior.held {
            belief.subject.0[*k] = 0.0;
        }
        let mut errors = errors.cloned();
        let mut found = None;
        for _ in 0..rounds {
            let Some(parts) = self.linearized(&belief, progress)? else {
                return Ok(None);
            };
            let steps = if errors.is_some() { STEPS } else { FIRST_STEPS };
            let Some(fit) = error_model::fit(&parts, &prior, errors.as_ref(), steps, progress)
            else {
                return Ok(None);
            };
            check(progress)?;
            let Some(whitened) = Whitened::new(&parts, &fit, &prior) else {
                return Ok(None);
            };
            errors = Some(fit.clone());
            let fitted = Fitted {
                belief,
                parts,
                errors: fit,
                whitened,
            };
            belief = fitted.belief_with(&fitted.belief.effects);
            found = Some(fitted);
        }
        Ok(found)
    }

    /// Stretches that no distribution of errors makes lose weight.
    pub fn weigh(&mut self, fitted: &Fitted) {
        for (weight, square) in self.weights.iter_mut().zip(&fitted.errors.squares) {
            *weight = (*weight * OUTLYING * NUMBERS as f64 / square).min(1.0);
        }
    }

    /// What is missing and what parameters change around effects that need not be those of the fit, reduced by it.
    ///
    /// The constants stay those of the fit. None where the model has no numbers, or where the search was cancelled.
    pub fn around(
        &self,
        fitted: &Fitted,
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<DMatrix<f64>> {
        let mut belief = Belief {
            effects: effects.clone(),
            ..fitted.belief.clone()
        };
        for k in self.prior_with(effects).held {
            belief.subject.0[k] = 0.0;
        }
        self.reduced_around(fitted, &belief, |stretch| {
            check(progress).ok()?;
            let track = self.track;
            let columns = effects_and_missing(track, stretch, &self.plain, &belief, parameters);
            Some(columns)
        })
    }

    /// The same flight under loads by description.
    #[must_use]
    pub fn under(&self, loads: &AppliedLoads<f64>) -> Self {
        let mut other = self.clone();
        other.plain.applied = *loads;
        other
    }

    /// Columns of every stretch around a belief, the last what is missing there, reduced by a fit. None where the model
    /// has no numbers, or `columns` gives none.
    pub fn reduced_around(
        &self,
        fitted: &Fitted,
        belief: &Belief,
        columns: impl Fn(&Stretch) -> Option<DMatrix<f64>> + Sync,
    ) -> Option<DMatrix<f64>> {
        let mut around = DVector::zeros(CONSTANTS);
        around
            .rows_mut(0, belief.joints.course[0].len())
            .copy_from(&belief.joints.course[0]);
        let bend = belief.joints.bend;
        around.rows_mut(bend.len(), bend.len()).copy_from(&bend);
        around.rows_mut(OWN, SUBJECT).copy_from(&belief.subject.0);
        let columns: Option<Vec<DMatrix<f64>>> = self
            .stretches
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
            .collect();
        Some(fitted.whitened.reduced(&columns?))
    }
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

    /// What the flight says of constants, with other effects.
    pub fn belief_with(&self, effects: &EffectSet) -> Belief {
        Belief {
            effects: effects.clone(),
            wander: self.errors.likely_wander(&self.parts),
            ..self.errors.belief(&self.belief)
        }
    }

    /// The same belief, with the likely wander.
    pub fn belief_wandering(&self) -> Belief {
        Belief {
            wander: self.errors.likely_wander(&self.parts),
            ..self.belief.clone()
        }
    }
}

/// A problem in deviations, with the constants of its flight ready to be taken out.
struct Whitened {
    factors: Vec<Cholesky<f64, Dyn>>,
    /// By stretch: constants in deviations.
    constants: Vec<DMatrix<f64>>,
    /// Information of the constants that the flight has for itself.
    own: Cholesky<f64, Dyn>,
    own_with_subject: DMatrix<f64>,
    /// Information of the subject once these are taken out.
    subject: DMatrix<f64>,
}

impl Whitened {
    fn new(parts: &[Part], errors: &Errors, prior: &Prior) -> Option<Self> {
        let each: Option<Vec<_>> = parts
            .par_iter()
            .map(|part| {
                let factor = part.covariance(&errors.sizes)?;
                let mut constants = part.constants.clone();
                factor.l_dirty().solve_lower_triangular_mut(&mut constants);
                let information = transposed_product(&constants, &constants);
                Some((factor, constants, information))
            })
            .collect();
        let (mut factors, mut constants) = (Vec::new(), Vec::new());
        let mut information = DMatrix::zeros(CONSTANTS, CONSTANTS);
        for (factor, part, part_information) in each? {
            factors.push(factor);
            constants.push(part);
            information += part_information;
        }
        let own_precision = errors.spread.own_precision(&prior.tolerances);
        for (k, precision) in own_precision.iter().enumerate() {
            information[(k, k)] += precision;
        }
        let own = information
            .view((0, 0), (OWN, OWN))
            .into_owned()
            .cholesky()?;
        let own_with_subject = information.view((0, OWN), (OWN, SUBJECT)).into_owned();
        let subject = information
            .view((OWN, OWN), (SUBJECT, SUBJECT))
            .into_owned()
            - own_with_subject.tr_mul(&own.solve(&own_with_subject));
        Some(Self {
            factors,
            constants,
            own,
            own_with_subject,
            subject,
        })
    }

    /// Information of subject and columns, with the constants of the flight taken out.
    fn reduced(&self, columns: &[DMatrix<f64>]) -> DMatrix<f64> {
        let count = columns.first().map_or(0, DMatrix::ncols);
        let each: Vec<_> = self
            .factors
            .par_iter()
            .zip(&self.constants)
            .zip(columns)
            .map(|((factor, constants), columns)| {
                let mut white = columns.clone();
                factor.l_dirty().solve_lower_triangular_mut(&mut white);
                (
                    transposed_product(constants, &white),
                    transposed_product(&white, &white),
                )
            })
            .collect();
        let mut with_constants = DMatrix::zeros(CONSTANTS, count);
        let mut with_columns = DMatrix::zeros(count, count);
        for (constants, columns) in each {
            with_constants += constants;
            with_columns += columns;
        }
        let own = with_constants.rows(0, OWN).into_owned();
        let taken = self.own.solve(&own);
        let subject = with_constants.rows(OWN, SUBJECT) - self.own_with_subject.tr_mul(&taken);
        with_columns -= own.tr_mul(&taken);
        let mut reduced = DMatrix::zeros(SUBJECT + count, SUBJECT + count);
        reduced
            .view_mut((0, 0), (SUBJECT, SUBJECT))
            .copy_from(&self.subject);
        reduced
            .view_mut((0, SUBJECT), (SUBJECT, count))
            .copy_from(&subject);
        reduced
            .view_mut((SUBJECT, 0), (count, SUBJECT))
            .copy_from(&subject.transpose());
        reduced
            .view_mut((SUBJECT, SUBJECT), (count, count))
            .copy_from(&with_columns);
        reduced
    }
}

/// Information and slope of some columns and the square of what is missing: half of the square less is what the
/// likelihood gains.
#[derive(Debug, Clone, PartialEq)]
pub struct Quadratic {
    /// Information.
    pub information: DMatrix<f64>,
    /// Slope.
    pub slope: DVector<f64>,
    /// Square of what is missing.
    pub square: f64,
}

impl Quadratic {
    /// Of flights with one subject: some columns of their reduced problems, of which the last is what is missing.
    pub fn joint(
        flights: &[DMatrix<f64>],
        columns: &[usize],
        precision: &DVector<f64>,
    ) -> Option<Self> {
        let size = flights.first()?.ncols();
        let mut sum = DMatrix::zeros(size, size);
        for flight in flights {
            sum += flight;
        }
        for (k, precision) in precision.iter().enumerate() {
            sum[(k, k)] += precision;
        }
        let mut kept: Vec<usize> = columns.iter().map(|column| SUBJECT + column).collect();
        kept.push(size - 1);
        let count = kept.len();
        let subject = sum
            .view((0, 0), (SUBJECT, SUBJECT))
            .into_owned()
            .cholesky()?;
        let cross = DMatrix::from_fn(SUBJECT, count, |j, k| sum[(j, kept[k])]);
        let rest = DMatrix::from_fn(count, count, |j, k| sum[(kept[j], kept[k])])
            - cross.tr_mul(&subject.solve(&cross));
        let last = count - 1;
        Some(Self {
            information: rest.view((0, 0), (last, last)).into_owned(),
            slope: rest.view((0, last), (last, 1)).column(0).into_owned(),
            square: rest[(last, last)],
        })
    }

    /// What is left of half the square after a step.
    pub fn left(&self, step: &DVector<f64>) -> f64 {
        0.5 * self.square - step.dot(&self.slope) + 0.5 * step.dot(&(&self.information * step))
    }

    /// The step that leaves least, with deviations of a prior about zero steps away from it, and its covariance.
    pub fn solved(
        &self,
        prior: &[f64],
        from: &DVector<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut information = self.information.clone();
        let mut slope = self.slope.clone();
        for (k, deviation) in prior.iter().enumerate() {
            let precision = deviation.powi(-2);
            information[(k, k)] += precision;
            slope[k] -= precision * from[k];
        }
        let factor = information.cholesky()?;
        Some((factor.solve(&slope), factor.inverse()))
    }
}
