//! The linear problem: residuals of all stretches, what each effect would change in them, and what may be wrong
//! without being an effect.
//!
//! Every column is a difference of two flights of the model, so an effect needs no code here. Columns and
//! residuals are whitened by the noise of sensors and starts.

use bodyflight_core::effect::{Effect, Model};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use super::fit::{Values, with};
use super::flown::{COARSE, Flown, Prepared};
use super::linear::Nuisances;
use super::stretch::{Channels, NUMBERS, Stretch, start_deviation, variance};
use super::tolerance::{self, Wrong};
use super::track::Track;

/// One parameter of an effect, a column of the problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The effect.
    pub effect: Effect,
    /// Which of its parameters.
    pub index: usize,
}

/// All parameters of some effects, in order.
pub fn places_of(effects: impl IntoIterator<Item = Effect>) -> Vec<Place> {
    let parameters = |effect: Effect| {
        let count = effect.description().parameters.len();
        (0..count).map(move |index| Place { effect, index })
    };
    effects.into_iter().flat_map(parameters).collect()
}

/// All parameters of all effects.
pub fn places() -> Vec<Place> {
    places_of(Effect::ALL.iter().copied())
}

/// Number of parameters of an effect.
pub fn freedom(effect: Effect) -> f64 {
    effect.description().parameters.len() as f64
}

/// What is added to a parameter for a difference.
fn step(place: Place) -> f64 {
    let parameter = &place.effect.description().parameters[place.index];
    0.02 * (parameter.high - parameter.low)
}

/// Whitened numbers of one stretch.
#[derive(Clone)]
pub struct Block {
    /// What each parameter of the places asked for changes.
    pub effects: DMatrix<f64>,
    /// What each nuisance changes.
    pub nuisances: Nuisances,
    /// The whitening.
    whitening: Cholesky<f64, Dyn>,
    /// Measured less flown in all frames.
    missing: DVector<f64>,
    /// Flown in long steps.
    flown: Flown,
}

/// The plain model with effects of which one parameter is changed by a small step, and the step that was possible.
///
/// Effects are applied from the plain model again: some multiply what is there, or take its place.
pub(super) fn changed(plain: &Model<f64>, values: &Values, place: Place) -> (Model<f64>, f64) {
    let mut values = values.clone();
    if !values.iter().any(|(effect, _)| *effect == place.effect) {
        values.push((place.effect, place.effect.neutral()));
    }
    let parameter = &place.effect.description().parameters[place.index];
    let mut size = step(place);
    for (effect, values) in &mut values {
        if *effect == place.effect {
            let value = &mut values[place.index];
            if *value + size > parameter.high {
                size = -size;
            }
            *value += size;
        }
    }
    (with(plain, &values), size)
}

/// A stretch with its numbers.
pub type Part = (Stretch, Block);

/// The problem around a model with effects, and around what joints and subject have wrong.
#[derive(Clone)]
pub struct Around {
    /// All stretches but those whose noise has no covariance.
    pub parts: Vec<Part>,
    /// Where it is.
    pub wrong: Wrong,
}

impl Around {
    /// Around `values` and `wrong`, with columns for some places.
    pub fn new(
        track: &Track,
        plain: &Model<f64>,
        stretches: Vec<Stretch>,
        (values, wrong): (&Values, &Wrong),
        places: &[Place],
    ) -> Self {
        let parts = stretches.into_par_iter().filter_map(|stretch| {
            let block = Block::new(track, &stretch, plain, (values, wrong), places)?;
            Some((stretch, block))
        });
        Self {
            parts: parts.collect(),
            wrong: wrong.clone(),
        }
    }

    /// The same problem, where another flight was measured that is `beyond` what was flown here, by stretch; without
    /// columns of effects, and from nothing wrong.
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
            wrong: Wrong::nothing(),
        }
    }
}

impl Block {
    fn new(
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        (values, wrong): (&Values, &Wrong),
        places: &[Place],
    ) -> Option<Self> {
        let none = Channels::zeros();
        let model = with(plain, values);
        let base = Prepared::new(track, stretch, &model, wrong, COARSE);
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
        let mut nuisances = DMatrix::zeros(NUMBERS, tolerance::COUNT);
        for k in 0..tolerance::COUNT {
            let other = base.changed_to(&model, &wrong.with(k)).fly(&none);
            nuisances.set_column(k, &white(&whitening, other.less(&flown)));
        }
        let fine = Prepared::new(track, stretch, &model, wrong, 1).fly(&none);
        let mut block = Self {
            effects: DMatrix::zeros(NUMBERS, 0),
            nuisances: nuisances.into(),
            whitening,
            missing: fine.missing(track, stretch),
            flown,
        };
        block.effects = block.columns((&base, &block.flown), plain, (values, wrong), places);
        Some(block)
    }

    /// Residual of a stretch in another model, whitened: that of here, flown in all frames, less what changes.
    pub fn residual(&self, flown: &Flown) -> DVector<f64> {
        self.white(&self.missing - flown.less(&self.flown))
    }

    /// What single parameters change in a flight with `values` and `wrong`, which was flown, whitened.
    pub fn columns(
        &self,
        (flight, flown): (&Prepared<'_>, &Flown),
        plain: &Model<f64>,
        (values, wrong): (&Values, &Wrong),
        places: &[Place],
    ) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(NUMBERS, places.len());
        let none = Channels::zeros();
        for (k, place) in places.iter().enumerate() {
            let (other, size) = changed(plain, values, *place);
            let column = flight.changed_to(&other, wrong).fly(&none).less(flown) / size;
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
pub struct FlownWrong {
    /// Less the flight of the body in the files.
    pub beyond_files: Vec<DVector<f64>>,
    /// Less the flight around which the problem is.
    pub beyond_around: Vec<DVector<f64>>,
}

/// Flights in a model in which joints and subject are `wrong`.
pub fn flown_wrong(
    track: &Track,
    around: &Around,
    model: &Model<f64>,
    wrong: &[Wrong],
) -> Vec<FlownWrong> {
    let fly = |wrong: &Wrong| -> Vec<Flown> {
        let of_stretch = |(stretch, _): &Part| {
            Prepared::new(track, stretch, model, wrong, COARSE).fly(&Channels::zeros())
        };
        around.parts.iter().map(of_stretch).collect()
    };
    let files = fly(&Wrong::nothing());
    let flown = wrong.par_iter().map(|wrong| {
        let flown = fly(wrong);
        let beyond = flown.iter().zip(&files).zip(&around.parts);
        let (beyond_files, beyond_around) = beyond
            .map(|((flown, files), (_, block))| (flown.less(files), flown.less(&block.flown)))
            .unzip();
        FlownWrong {
            beyond_files,
            beyond_around,
        }
    });
    flown.collect()
}
