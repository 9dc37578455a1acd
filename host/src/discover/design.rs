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

/// All parameters of all effects, in order.
pub fn places() -> Vec<Place> {
    let parameters = |&effect: &Effect| {
        let count = effect.description().parameters.len();
        (0..count).map(move |index| Place { effect, index })
    };
    Effect::ALL.iter().flat_map(parameters).collect()
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
    /// What each nuisance changes, in deviations of its prior.
    pub nuisances: DMatrix<f64>,
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
        let model = &wrong.of(&with(plain, values));
        let base = Prepared::new(track, stretch, model, &wrong.joints(), COARSE);
        // The start is free within what smoothing leaves: it adds to the noise.
        let flown = base.fly(&none);
        let mut covariance = DMatrix::from_diagonal(&variance());
        for (channel, deviation) in start_deviation().iter().enumerate() {
            let mut start = none;
            start[channel] = *deviation;
            let column = base.fly(&start).less(&flown);
            covariance += &column * column.transpose();
        }
        let fine = Prepared::new(track, stretch, model, &wrong.joints(), 1).fly(&none);
        let mut block = Self {
            effects: DMatrix::zeros(NUMBERS, 0),
            nuisances: DMatrix::zeros(NUMBERS, tolerance::COUNT),
            whitening: covariance.cholesky()?,
            missing: fine.missing(track, stretch),
            flown,
        };
        block.effects = block.columns(track, stretch, plain, (values, wrong), places);
        for k in 0..tolerance::COUNT {
            let other = fly(track, stretch, &with(plain, values), &wrong.with(k));
            let column = block.white(other.less(&block.flown));
            block.nuisances.set_column(k, &column);
        }
        Some(block)
    }

    /// Residual of a stretch in another model, whitened: that of here, flown in all frames, less what changes.
    pub fn residual(
        &self,
        track: &Track,
        stretch: &Stretch,
        model: &Model<f64>,
        wrong: &Wrong,
    ) -> DVector<f64> {
        let flown = fly(track, stretch, model, wrong);
        self.white(&self.missing - flown.less(&self.flown))
    }

    /// What single parameters change in a stretch in another model, whitened.
    pub fn columns(
        &self,
        track: &Track,
        stretch: &Stretch,
        plain: &Model<f64>,
        (values, wrong): (&Values, &Wrong),
        places: &[Place],
    ) -> DMatrix<f64> {
        let mut columns = DMatrix::zeros(NUMBERS, places.len());
        if places.is_empty() {
            return columns;
        }
        let base = fly(track, stretch, &with(plain, values), wrong);
        for (k, place) in places.iter().enumerate() {
            let (other, size) = changed(plain, values, *place);
            let column = fly(track, stretch, &other, wrong).less(&base) / size;
            columns.set_column(k, &self.white(column));
        }
        columns
    }

    /// A residual in deviations.
    pub fn white(&self, mut residual: DVector<f64>) -> DVector<f64> {
        let lower = self.whitening.l_dirty();
        lower.solve_lower_triangular_mut(&mut residual);
        residual
    }

    /// Noise of sensors and start with the given deviations.
    pub fn noise(&self, deviations: &DVector<f64>) -> DVector<f64> {
        self.whitening.l() * deviations
    }
}

/// Flights in a model in which joints and subject are wrong, less the flight in that model: by stretch, then as in
/// `wrong`.
pub fn flown_wrong(
    track: &Track,
    around: &Around,
    model: &Model<f64>,
    wrong: &[Wrong],
) -> Vec<Vec<DVector<f64>>> {
    let of_stretch = |(stretch, _): &Part| {
        let base = fly(track, stretch, model, &Wrong::nothing());
        let apart = wrong
            .iter()
            .map(|wrong| fly(track, stretch, model, wrong).less(&base));
        apart.collect()
    };
    around.parts.par_iter().map(of_stretch).collect()
}

/// Flies a stretch in long steps.
fn fly(track: &Track, stretch: &Stretch, model: &Model<f64>, wrong: &Wrong) -> Flown {
    Prepared::new(track, stretch, &wrong.of(model), &wrong.joints(), COARSE).fly(&Channels::zeros())
}
