//! Effects fitted to the residuals, with the nuisances taken out.

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::design::{Block, Place, blocks, subject_places};
use super::stretch::Stretch;
use super::track::Track;

/// Steps of Gauss and Newton.
const STEPS: usize = 5;

/// Misfit, its slope and curvature in some parameters, after the nuisances have done what their priors allow.
#[derive(Debug, Clone)]
pub struct Reduced {
    /// Sum of squares of the whitened residual.
    pub misfit: f64,
    /// Columns times residual.
    pub slope: DVector<f64>,
    /// Columns times columns.
    pub curvature: DMatrix<f64>,
}

impl Reduced {
    /// Of stretches given as residual, columns, nuisances.
    pub fn of<'a>(
        parts: impl Iterator<Item = (&'a DVector<f64>, &'a DMatrix<f64>, &'a DMatrix<f64>)>,
    ) -> Self {
        let mut sums: Option<[DMatrix<f64>; 5]> = None;
        let mut misfit = 0.0;
        for (residual, columns, nuisances) in parts {
            misfit += residual.norm_squared();
            let parts = [
                columns.tr_mul(columns),
                columns.tr_mul(nuisances),
                nuisances.tr_mul(nuisances),
                DMatrix::from_column_slice(columns.ncols(), 1, columns.tr_mul(residual).as_slice()),
                DMatrix::from_column_slice(
                    nuisances.ncols(),
                    1,
                    nuisances.tr_mul(residual).as_slice(),
                ),
            ];
            match &mut sums {
                Some(sums) => sums
                    .iter_mut()
                    .zip(parts)
                    .for_each(|(sum, part)| *sum += part),
                None => sums = Some(parts),
            }
        }
        let Some([gg, gn, nn, gr, nr]) = sums else {
            return Self {
                misfit: 0.0,
                slope: DVector::zeros(0),
                curvature: DMatrix::zeros(0, 0),
            };
        };
        // Nuisances are in deviations: their prior is one.
        let prior = DMatrix::identity(nn.nrows(), nn.nrows());
        let Some(held) = (nn + prior).cholesky() else {
            return Self {
                misfit,
                slope: gr.column(0).into_owned(),
                curvature: gg,
            };
        };
        let taken = held.solve(&nr);
        Self {
            misfit: misfit - nr.dot(&taken),
            slope: (&gr - &gn * &taken).column(0).into_owned(),
            curvature: &gg - &gn * held.solve(&gn.transpose()),
        }
    }

    /// Of some of its columns alone.
    pub fn only(&self, columns: &[usize]) -> Self {
        Self {
            misfit: self.misfit,
            slope: DVector::from_fn(columns.len(), |k, _| self.slope[columns[k]]),
            curvature: DMatrix::from_fn(columns.len(), columns.len(), |j, k| {
                self.curvature[(columns[j], columns[k])]
            }),
        }
    }

    /// The step that lowers the misfit most, and the covariance of the parameters; `priors` are deviations.
    pub fn solved(&self, priors: &[f64]) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut curvature = self.curvature.clone();
        for (k, prior) in priors.iter().enumerate() {
            curvature[(k, k)] += 1.0 / (prior * prior);
        }
        let factor = curvature.cholesky()?;
        Some((factor.solve(&self.slope), factor.inverse()))
    }

    /// By how much these parameters lower the misfit, to first order.
    pub fn gain(&self, priors: &[f64]) -> f64 {
        self.solved(priors)
            .map_or(0.0, |(step, _)| step.dot(&self.slope))
    }
}

/// Effects with their parameters.
pub type Values = Vec<(Effect, [f64; PARAMETER_COUNT])>;

/// A model with effects.
pub fn with(model: &Model<f64>, values: &Values) -> Model<f64> {
    let mut model = *model;
    let mut sorted = values.clone();
    sorted.sort_by_key(|(effect, _)| *effect);
    for (effect, values) in &sorted {
        // Kept inside the plausible ranges.
        let _ = effect.apply(values, &mut model);
    }
    model
}

/// Parameters of effects as columns, and how far each may go.
fn columns(values: &Values) -> (Vec<Place>, Vec<f64>) {
    let places: Vec<Place> = values
        .iter()
        .flat_map(|&(effect, _)| {
            let count = effect.description().parameters.len();
            (0..count).map(move |index| Place { effect, index })
        })
        .collect();
    let reach = places.iter().map(|place| reach(*place)).collect();
    (places, reach)
}

/// Half of the plausible range: the prior of a parameter.
pub fn reach(place: Place) -> f64 {
    let parameter = &place.effect.description().parameters[place.index];
    0.5 * (parameter.high - parameter.low)
}

/// Effects fitted to some stretches.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The effects with their parameters.
    pub values: Values,
    /// Standard errors, in the order of the parameters.
    pub errors: Vec<f64>,
    /// Misfit that is left.
    pub misfit: f64,
}

/// A set of stretches to fit to, with the problem around the plain model.
#[derive(Clone, Copy)]
pub struct Data<'a> {
    /// The flight.
    pub track: &'a Track,
    /// The plain model.
    pub model: &'a Model<f64>,
    /// Stretches with their blocks.
    pub stretches: &'a [(Stretch, Block)],
}

impl Data<'_> {
    /// Residuals around some effects: misfit and slopes of the stretches that `choose` takes.
    fn around(&self, values: &Values, choose: impl Fn(usize) -> bool + Sync) -> Reduced {
        let (places, _) = columns(values);
        let parts: Vec<_> = self
            .stretches
            .par_iter()
            .enumerate()
            .filter(|(k, _)| choose(*k))
            .map(|(_, (stretch, block))| {
                let (white, columns) =
                    block.around(self.track, stretch, self.model, values, &places);
                (white, columns, &block.nuisances)
            })
            .collect();
        Reduced::of(
            parts
                .iter()
                .map(|(white, columns, nuisances)| (white, columns, *nuisances)),
        )
    }

    /// The problem around some effects: what joints and subject have wrong acts differently in another model.
    pub fn moved_to(&self, values: &Values) -> Vec<(Stretch, Block)> {
        let stretches = self.stretches.iter().map(|(stretch, _)| stretch.clone());
        let nuisances = subject_places();
        blocks(
            self.track,
            self.model,
            stretches.collect(),
            values,
            &nuisances,
        )
    }

    /// Misfit of some effects as they are.
    pub fn misfit(&self, values: &Values, choose: impl Fn(usize) -> bool + Sync) -> f64 {
        self.around(values, choose).misfit
    }

    /// Fits the parameters of `values` from where they are.
    pub fn fit(&self, mut values: Values, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        let (places, reach) = columns(&values);
        let mut reduced = self.around(&values, choose);
        let mut errors = vec![f64::INFINITY; places.len()];
        for _ in 0..STEPS {
            let Some((step, covariance)) = reduced.solved(&reach) else {
                break;
            };
            errors = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
            // Halved until it helps: the model is not linear.
            let mut share = 1.0;
            let mut better = None;
            for _ in 0..4 {
                let tried = moved(&values, &(&step * share));
                let around = self.around(&tried, choose);
                if around.misfit < reduced.misfit {
                    better = Some((tried, around));
                    break;
                }
                share *= 0.4;
            }
            let Some((tried, around)) = better else {
                break;
            };
            let gained = reduced.misfit - around.misfit;
            values = tried;
            reduced = around;
            if gained < 0.05 {
                break;
            }
        }
        Fit {
            values,
            errors,
            misfit: reduced.misfit,
        }
    }
}

/// Parameters after a step, inside their plausible ranges.
fn moved(values: &Values, step: &DVector<f64>) -> Values {
    let mut steps = step.iter();
    values
        .iter()
        .map(|&(effect, mut values)| {
            for (value, parameter) in values.iter_mut().zip(effect.description().parameters) {
                let step = steps.next().copied().unwrap_or(0.0);
                *value = (*value + step).clamp(parameter.low, parameter.high);
            }
            (effect, values)
        })
        .collect()
}
