//! The search linearized about effects and nuisances: residuals of all stretches, and what each parameter of an effect
//! and each nuisance would change in them.
//!
//! Every column is a difference of two flights of the model, so an effect needs no code here. Columns and
//! residuals are whitened by the noise of sensors and starts.

use bodyflight_core::effect::Model;
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::effect_set::{EffectSet, ParameterId, changed, extended};
use super::flown::{COARSE, Flown, Prepared};
use super::normal_equations::NuisanceColumns;
use super::nuisance::{COUNT, Nuisance};
use super::stretch::{Channels, NUMBERS, Stretch, start_deviation, variance};
use super::track::Track;

/// Whitened numbers of one stretch.
#[derive(Clone)]
pub struct Block {
    /// What each parameter asked for changes.
    pub effects: DMatrix<f64>,
    /// What each nuisance changes.
    pub nuisances: NuisanceColumns,
    /// The whitening.
    whitening: Cholesky<f64, Dyn>,
    /// Measured less flown in all frames.
    missing: DVector<f64>,
    /// Flown in long steps.
    flown: Flown,
}

/// A stretch with its numbers.
pub type Part = (Stretch, Block);

/// The problem linearized about a model with effects, and about what joints and subject have wrong.
#[derive(Clone)]
pub struct Linearization {
    /// All stretches but those whose noise has no covariance.
    pub parts: Vec<Part>,
    /// What joints and subject have wrong there.
    pub nuisance: Nuisance,
}

impl Linearization {
    /// About `effects` and `nuisance`, with columns for some parameters.
    pub fn new(
        track: &Track,
        plain: &Model<f64>,
        stretches: Vec<Stretch>,
        (effects, nuisance): (&EffectSet, &Nuisance),
        parameters: &[ParameterId],
    ) -> Self {
        let parts = stretches.into_par_iter().filter_map(|stretch| {
            let block = Block::new(track, &stretch, plain, (effects, nuisance), parameters)?;
            Some((stretch, block))
        });
        Self {
            parts: parts.collect(),
            nuisance: nuisance.clone(),
        }
    }

    /// The same problem, where another flight was measured that is `beyond` what was flown here, by stretch; without
    /// columns of effects, and with nothing wrong.
    pub fn measuring(&self, beyond: &[DVector<f64>]) -> Self {
        let part = |((stretch, block), missing): (&Part, &DVector<f64>)| {
            let block = Block {
                effects: DMatrix::zeros(NUMBERS, 0),
                nuisances: block.nuisances.clone(),
                whitening: block.whitening.clone(),
                missing: missing.clone(),
                flown: block.flown.clone(),
            };
            (stretch.clone(), block)
        };
        Self {
            parts: self.parts.iter().zip(beyond).map(part).collect(),
            nuisance: Nuisance::none(),
        }
    }
}

impl Block {
    fn new(
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        (effects, nuisance): (&EffectSet, &Nuisance),
        parameters: &[ParameterId],
    ) -> Option<Self> {
        let none = Channels::zeros();
        let model = extended(plain, effects);
        let base = Prepared::new(track, stretch, &model, nuisance, COARSE);
        // The start is free within what smoothing leaves: it adds to the noise.
        let flown = base.fly(&none);
        let mut covariance = DMatrix::from_diagonal(&variance());
        for (channel, deviation) in start_deviation().iter().enumerate() {
            let mut start = none;
            start[channel] = *deviation;
            let column = base.fly(&start).less(&flown);
            covariance += &column * column.transpose();
        }
        let whitening = covariance.cholesky()?;
        let mut nuisances = DMatrix::zeros(NUMBERS, COUNT);
        for k in 0..COUNT {
            let other = base.changed_to(&model, &nuisance.with(k)).fly(&none);
            nuisances.set_column(k, &white(&whitening, other.less(&flown)));
        }
        let fine = Prepared::new(track, stretch, &model, nuisance, 1).fly(&none);
        let mut block = Self {
            effects: DMatrix::zeros(NUMBERS, 0),
            nuisances: nuisances.into(),
            whitening,
            missing: fine.missing(track, stretch),
            flown,
        };
        block.effects = block.columns(
            (&base, &block.flown),
            plain,
            (effects, nuisance),
            parameters,
        );
        Some(block)
    }

    /// Residual of a stretch in another model, whitened: that of here, flown in all frames, less what changes.
    pub fn residual(&self, flown: &Flown) -> DVector<f64> {
        self.white(&self.missing - flown.less(&self.flown))
    }

    /// What single parameters change in a flight with `effects` and `nuisance`, which was flown, whitened.
    pub fn columns(
        &self,
        (flight, flown): (&Prepared<'_>, &Flown),
        plain: &Model<f64>,
        (effects, nuisance): (&EffectSet, &Nuisance),
        parameters: &[ParameterId],
    ) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(NUMBERS, parameters.len());
        let none = Channels::zeros();
        for (k, id) in parameters.iter().enumerate() {
            let (other, size) = changed(plain, effects, *id);
            let column = flight.changed_to(&other, nuisance).fly(&none).less(flown) / size;
            columns.set_column(k, &self.white(column));
        }
        columns
    }

    /// A residual in deviations.
    fn white(&self, residual: DVector<f64>) -> DVector<f64> {
        white(&self.whitening, residual)
    }

    /// Noise of sensors and start with the given deviations.
    pub fn noise(&self, deviations: &DVector<f64>) -> DVector<f64> {
        self.whitening.l() * deviations
    }
}

fn white(whitening: &Cholesky<f64, Dyn>, mut residual: DVector<f64>) -> DVector<f64> {
    whitening
        .l_dirty()
        .solve_lower_triangular_mut(&mut residual);
    residual
}

/// A flight in which joints and subject are wrong, by stretch.
pub struct PerturbedFlight {
    /// Less the flight of the body in the files.
    pub beyond_files: Vec<DVector<f64>>,
    /// Less the flight about which the problem is linearized.
    pub beyond_linearization: Vec<DVector<f64>>,
}

/// Flights in a model in which joints and subject have each of `nuisances` wrong.
pub fn flown_with(
    track: &Track,
    linearization: &Linearization,
    model: &Model<f64>,
    nuisances: &[Nuisance],
) -> Vec<PerturbedFlight> {
    let fly = |nuisance: &Nuisance| -> Vec<Flown> {
        let of_stretch = |(stretch, _): &Part| {
            Prepared::new(track, stretch, model, nuisance, COARSE).fly(&Channels::zeros())
        };
        linearization.parts.iter().map(of_stretch).collect()
    };
    let files = fly(&Nuisance::none());
    let flown = nuisances.par_iter().map(|nuisance| {
        let flown = fly(nuisance);
        let beyond = flown.iter().zip(&files).zip(&linearization.parts);
        let (beyond_files, beyond_linearization) = beyond
            .map(|((flown, files), (_, block))| (flown.less(files), flown.less(&block.flown)))
            .unzip();
        PerturbedFlight {
            beyond_files,
            beyond_linearization,
        }
    });
    flown.collect()
}
