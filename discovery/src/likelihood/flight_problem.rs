//! A flight as a linear problem: fits its errors, and reduces columns by marginalizing the constants.

use std::sync::{Arc, OnceLock};

use crate::named_effect::EffectSet;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::effect::Model;
use bodyflight_core::tolerances::Tolerances;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::error::{Error, Result};
use crate::input::flight::RecordedFlight;
use crate::input::sensor_noise::recorded_noise;
use crate::jacobian::columns::finite;
use crate::jacobian::effect_parameters::{ParameterId, all_parameters, random};
use crate::jacobian::finite_difference::{effects_alone, linearized, random_effects, residual};
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::likelihood::factor::{StretchFactor, WeighedFlight};
use crate::likelihood::known_residuals::KnownResiduals;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::{Prior, unaliased};
use crate::likelihood::schur::SchurComplement;
use crate::likelihood::variance_components::{self, FittedErrors};
use crate::progress::{Progress, check};
use crate::shooting::smoothed_start::{is_short, stretches};
use crate::shooting::stretch::Stretch;

/// Maximum number of steps in a fit of the errors: from the prior, and from a similar fit.
const FIRST_STEPS: usize = 20;
const NEXT_STEPS: usize = 8;
/// The same if the slopes of another fit are reused: several such fits follow one another.
const FURTHER_STEPS: usize = 3;

/// Squared residuals per observation above which a stretch loses weight, since no distribution of errors produces them.
const OUTLYING: f64 = 3.0;

/// A flight to be explained.
#[derive(Clone)]
pub struct FlightProblem<'a> {
    /// The flight.
    pub track: &'a RecordedFlight,
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
    known: KnownResiduals,
}

impl<'a> FlightProblem<'a> {
    /// Estimates the sensor noise and cuts the flight into stretches.
    pub fn new(track: &'a RecordedFlight, tolerances: &Tolerances) -> Self {
        let plain = Model::new(track.dynamics, track.start_height());
        let noise = recorded_noise(track);
        let stretches = stretches(track, noise[1]);
        Self {
            track,
            plain,
            weights: vec![1.0; stretches.len()],
            stretches,
            noise,
            prior: Prior::new(&noise, tolerances, is_short(track)),
            known: KnownResiduals::default(),
        }
    }

    /// The residual of each stretch, or an error if the search was cancelled.
    fn residuals(
        &self,
        point: &LinearizationPoint,
        progress: &dyn Progress,
    ) -> Result<Arc<[DVector<f64>]>> {
        let of = |stretch: &Stretch| {
            check(progress).ok()?;
            Some(residual(self.track, stretch, &self.plain, point))
        };
        let each = || self.stretches.par_iter().map(of).collect();
        self.known.at(point, each).ok_or(Error::Cancelled)
    }

    fn linearized(
        &self,
        point: &LinearizationPoint,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<StretchFactor>>> {
        let residuals = self.residuals(point, progress)?;
        let parts: Option<Vec<StretchFactor>> = self
            .stretches
            .par_iter()
            .zip(&self.weights)
            .zip(&*residuals)
            .map(|((stretch, weight), residual)| {
                check(progress).ok()?;
                let columns = linearized(self.track, stretch, &self.plain, point, residual)?;
                let mut part = StretchFactor::new(stretch, columns, point);
                part.weight = *weight;
                let random = random(&point.effects);
                let varying = random_effects(self.track, stretch, &self.plain, point, &random);
                part.varying = varying.map(Arc::new);
                Some(part)
            })
            .collect();
        check(progress)?;
        Ok(parts)
    }

    /// Drops stretches in which the simulation diverges.
    pub fn without_stretches_beyond_numbers(&mut self, point: &LinearizationPoint) {
        let flies = |stretch: &Stretch| {
            let residual = residual(self.track, stretch, &self.plain, point);
            residual.iter().all(|value| value.is_finite())
        };
        self.stretches.retain(flies);
        self.weights = vec![1.0; self.stretches.len()];
    }

    /// Fits the errors, relinearizing `rounds` times, starting from `errors` if given. Returns `None` if the simulation
    /// diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn fit(
        &self,
        point: &LinearizationPoint,
        errors: Option<&FittedErrors>,
        rounds: usize,
        progress: &dyn Progress,
    ) -> Result<Option<LinearFit>> {
        let mut point = unaliased(point.clone());
        let mut errors = errors.cloned();
        let mut found = None;
        for _ in 0..rounds {
            let Some(parts) = self.linearized(&point, progress)? else {
                return Ok(None);
            };
            let steps = if errors.is_some() {
                NEXT_STEPS
            } else {
                FIRST_STEPS
            };
            let slopes_at = Arc::new(point.clone());
            let start = (errors.as_ref(), None);
            let Some(fitted) = self.fitted(parts, (point, slopes_at), start, steps, progress)?
            else {
                return Ok(None);
            };
            errors = Some(fitted.errors.clone());
            point = fitted.point_with(&fitted.point.effects);
            found = Some(fitted);
        }
        Ok(found)
    }

    /// Fits the errors of the model as given by the files, without any effect. Returns `None` if the simulation
    /// diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn first(&self, progress: &dyn Progress) -> Result<Option<LinearFit>> {
        let point = LinearizationPoint::files();
        let slopes_at = Arc::new(point.clone());
        let Some(parts) = self.linearized(&point, progress)? else {
            return Ok(None);
        };
        let start = (None, None);
        self.fitted(parts, (point, slopes_at), start, FIRST_STEPS, progress)
    }

    /// Fits the errors around another point, reusing the slopes of a fit. Only the residual is simulated again, which
    /// is far cheaper than recomputing all slopes. Returns `None` if the simulation diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub fn fit_with_slopes_of(
        &self,
        fitted: &LinearFit,
        point: &LinearizationPoint,
        progress: &dyn Progress,
    ) -> Result<Option<LinearFit>> {
        let point = unaliased(point.clone());
        let residuals = self.residuals(&point, progress)?;
        let around = |(part, residual): (&StretchFactor, &DVector<f64>)| {
            let finite = residual.iter().all(|value| value.is_finite());
            finite.then(|| part.clone().around(residual, &point))
        };
        let each = fitted.parts.par_iter().zip(&*residuals);
        let parts: Option<Vec<StretchFactor>> = each.map(around).collect();
        check(progress)?;
        let Some(parts) = parts else {
            return Ok(None);
        };
        let start = (Some(&fitted.errors), Some(&fitted.whitened.weighed));
        let points = (point, fitted.slopes_at.clone());
        self.fitted(parts, points, start, FURTHER_STEPS, progress)
    }

    fn fitted(
        &self,
        parts: Vec<StretchFactor>,
        (point, slopes_at): (LinearizationPoint, Arc<LinearizationPoint>),
        start: (Option<&FittedErrors>, Option<&Arc<WeighedFlight>>),
        steps: usize,
        progress: &dyn Progress,
    ) -> Result<Option<LinearFit>> {
        let prior = self.prior.given(&point.effects);
        let estimate = variance_components::fit_from(&parts, &prior, start, steps, progress);
        check(progress)?;
        let Some(estimate) = estimate else {
            return Ok(None);
        };
        let prior_deviations = estimate.errors.prior_deviations;
        let whitened = SchurComplement::new(estimate.weighed, &prior_deviations);
        Ok(whitened.map(|whitened| LinearFit {
            point,
            slopes_at,
            parts,
            errors: estimate.errors,
            whitened,
            all_effects: OnceLock::new(),
            joint_limit: prior.tolerances.joint_limit_deg().to_radians(),
        }))
    }

    /// Reduces the weight of outlying stretches.
    pub fn weigh(&mut self, fitted: &LinearFit) {
        let squares = fitted.errors.squares.iter().zip(&self.stretches);
        for (weight, (square, stretch)) in self.weights.iter_mut().zip(squares) {
            let expected = stretch.grid.residuals() as f64;
            *weight = (*weight * OUTLYING * expected / square).min(1.0);
        }
    }

    /// The residual and the derivatives with respect to some parameters, around effects that may differ from those of
    /// the fit, reduced by the fit.
    ///
    /// The constants stay those of the fit. Returns `None` if the simulation diverges or the search was cancelled.
    pub fn around(
        &self,
        fitted: &LinearFit,
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
        fitted: &LinearFit,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<DMatrix<f64>> {
        let columns = finite(self.columns_at(&fitted.point, fitted, parameters, progress)?)?;
        Some(fitted.whitened.reduced(&columns))
    }

    /// The same with columns for all effects, at the point at which the other slopes of the fit were computed. Few fits
    /// are compared with all effects, so the columns are computed when they are asked for. Those of an effect with which
    /// the simulation diverges are not finite. Returns `None` if the search was cancelled.
    pub fn all_effects<'b>(
        &self,
        fitted: &'b LinearFit,
        progress: &dyn Progress,
    ) -> Option<&'b DMatrix<f64>> {
        if fitted.all_effects.get().is_none() {
            let parameters = all_parameters();
            let columns = self.columns_at(&fitted.slopes_at, fitted, &parameters, progress)?;
            let reduced = fitted.whitened.reduced(&columns);
            fitted.all_effects.get_or_init(|| reduced);
        }
        fitted.all_effects.get()
    }

    /// The derivatives with respect to some parameters at a point, and the residual of the fit in the last column.
    fn columns_at(
        &self,
        point: &LinearizationPoint,
        fitted: &LinearFit,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<Vec<DMatrix<f64>>> {
        let each = self.stretches.par_iter().zip(&fitted.parts);
        each.map(|(stretch, part)| {
            check(progress).ok()?;
            let slopes = effects_alone(self.track, stretch, &self.plain, point, parameters);
            let mut columns = slopes.insert_column(parameters.len(), 0.0);
            columns.set_column(parameters.len(), &part.residual);
            Some(columns)
        })
        .collect()
    }

    /// The same for each stretch, before the reduction. With effects that change nothing in the model of the fit, the
    /// residual is known.
    pub fn columns_around(
        &self,
        fitted: &LinearFit,
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<Vec<DMatrix<f64>>> {
        let point = unaliased(LinearizationPoint {
            effects: effects.clone(),
            ..fitted.point.clone()
        });
        if point.model(&self.plain) == fitted.point.model(&self.plain) {
            return finite(self.columns_at(&point, fitted, parameters, progress)?);
        }
        let residuals = self.residuals(&point, progress).ok()?;
        self.columns_of(fitted, &point, |k, stretch| {
            check(progress).ok()?;
            let slopes = effects_alone(self.track, stretch, &self.plain, &point, parameters);
            let mut columns = slopes.insert_column(parameters.len(), 0.0);
            columns.set_column(parameters.len(), &residuals[k]);
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
        fitted: &LinearFit,
        point: &LinearizationPoint,
        columns: impl Fn(&Stretch) -> Option<DMatrix<f64>> + Sync,
    ) -> Option<DMatrix<f64>> {
        let columns = self.columns_of(fitted, point, |_, stretch| columns(stretch))?;
        Some(fitted.whitened.reduced(&columns))
    }

    fn columns_of(
        &self,
        fitted: &LinearFit,
        point: &LinearizationPoint,
        columns: impl Fn(usize, &Stretch) -> Option<DMatrix<f64>> + Sync,
    ) -> Option<Vec<DMatrix<f64>>> {
        let around = point.constants();
        self.stretches
            .par_iter()
            .zip(&fitted.parts)
            .enumerate()
            .map(|(k, (stretch, part))| {
                let mut columns = columns(k, stretch)?;
                let last = columns.ncols() - 1;
                let mut residual = columns.column_mut(last);
                residual += &*part.constants * &around + &part.wandered;
                let finite = columns.iter().all(|value| value.is_finite());
                finite.then_some(columns)
            })
            .collect()
    }
}
