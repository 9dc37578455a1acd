//! Effects fitted to the residuals, with the nuisances taken out.

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::design::{Around, Place};
use super::linear::{Normal, Reduced, Right, sum};
use super::tolerance::Wrong;
use super::track::Track;

/// Steps of Gauss and Newton until nothing changes, at most.
const STEPS: usize = 12;
const SKETCH_STEPS: usize = 5;

/// Gain from which on another problem is worth setting up.
const SETTLED: f64 = 10.0;

/// Times that a step is held back, at most.
const TRIES: usize = 5;

/// Gain that is as good as none.
const CLOSE: f64 = 0.2;

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
pub(super) fn columns(values: &Values) -> (Vec<Place>, Vec<f64>) {
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
    /// What joints and subject have wrong beside them.
    pub wrong: Wrong,
    /// Standard errors, in the order of the parameters.
    pub errors: Vec<f64>,
    /// Misfit that is left.
    pub misfit: f64,
}

/// What joints and subject do while effects are fitted.
#[derive(Clone, Copy)]
enum Nuisances {
    /// They are fitted too.
    Move,
    /// They act to first order where they stand.
    Stay,
}

/// A flight to fit to, with the problem around a model.
#[derive(Clone, Copy)]
pub struct Data<'a> {
    /// The flight.
    pub track: &'a Track,
    /// The plain model.
    pub model: &'a Model<f64>,
    /// The problem around some effects.
    pub around: &'a Around,
}

impl<'a> Data<'a> {
    /// A flight, the plain model, and the problem around some effects.
    pub const fn new(track: &'a Track, model: &'a Model<f64>, around: &'a Around) -> Self {
        Self {
            track,
            model,
            around,
        }
    }

    /// The same flight around something else.
    pub const fn with(self, around: &'a Around) -> Self {
        Self { around, ..self }
    }

    /// The problem around some effects, with columns for some places: what joints and subject have wrong acts
    /// differently in another model.
    pub fn moved_to(&self, values: &Values, wrong: &Wrong, places: &[Place]) -> Around {
        let stretches = self.around.parts.iter().map(|(stretch, _)| stretch.clone());
        let stretches = stretches.collect();
        Around::new(self.track, self.model, stretches, (values, wrong), places)
    }

    /// Products of residuals with slopes in some places and with nuisances, of the stretches that `choose` takes.
    fn linear(
        &self,
        values: &Values,
        wrong: &Wrong,
        places: &[Place],
        choose: impl Fn(usize) -> bool + Sync,
    ) -> (Normal, Right) {
        let model = with(self.model, values);
        let parts: Vec<_> = self
            .around
            .parts
            .par_iter()
            .enumerate()
            .filter(|(k, _)| choose(*k))
            .map(|(_, (stretch, block))| {
                let white = block.residual(self.track, stretch, &model, wrong);
                let columns =
                    block.columns(self.track, stretch, self.model, (values, wrong), places);
                (
                    Normal::of(&columns, &block.nuisances),
                    Right::of(&white, &columns, &block.nuisances),
                )
            })
            .collect();
        let normal = sum(parts.iter().map(|(normal, _)| normal));
        let right = sum(parts.iter().map(|(_, right)| right));
        normal.zip(right).unwrap_or_else(|| {
            let (none, nuisances) = (
                DMatrix::zeros(0, places.len()),
                DMatrix::zeros(0, wrong.0.len()),
            );
            (
                Normal::of(&none, &nuisances),
                Right::of(&DVector::zeros(0), &none, &nuisances),
            )
        })
    }

    /// Effects as they are, with what joints and subject have wrong fitted beside them.
    pub fn settled(&self, values: &Values, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        self.minimised(values.clone(), &[], Nuisances::Move, choose)
    }

    /// Fits the parameters of `values` from where they are, with joints and subject.
    pub fn fit(&self, values: Values, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        let (places, _) = columns(&values);
        self.minimised(values, &places, Nuisances::Move, choose)
    }

    /// Fits them with joints and subject to first order: cheap, and it converges from afar.
    pub fn sketched(&self, values: Values) -> Fit {
        let (places, _) = columns(&values);
        self.minimised(values, &places, Nuisances::Stay, |_| true)
    }

    /// Fits in the problem around each fit, at most `problems` of them, until that changes nothing.
    pub fn refined(&self, fit: Fit, problems: usize) -> (Fit, Around) {
        let (places, _) = columns(&fit.values);
        self.refined_in(fit, &places, problems)
    }

    /// Effects as they are, joints and subject fitted in the problem around each fit.
    pub fn settled_refined(&self, values: &Values, problems: usize) -> (Fit, Around) {
        let fit = self.settled(values, |_| true);
        self.refined_in(fit, &[], problems)
    }

    fn refined_in(&self, mut fit: Fit, places: &[Place], problems: usize) -> (Fit, Around) {
        let mut around = self.moved_to(&fit.values, &fit.wrong, &[]);
        for problem in 1.. {
            let before = fit.misfit;
            let there = self.with(&around);
            fit = there.minimised(fit.values, places, Nuisances::Move, |_| true);
            if problem >= problems || before - fit.misfit < SETTLED {
                break;
            }
            around = self.moved_to(&fit.values, &fit.wrong, &[]);
        }
        (fit, around)
    }

    fn minimised(
        &self,
        mut values: Values,
        places: &[Place],
        nuisances: Nuisances,
        choose: impl Fn(usize) -> bool + Sync + Copy,
    ) -> Fit {
        let reach: Vec<f64> = places.iter().map(|place| reach(*place)).collect();
        let mut wrong = self.around.wrong.clone();
        let mut here = self.linear(&values, &wrong, places, choose);
        let mut errors = vec![f64::INFINITY; places.len()];
        let misfit = |(normal, right): &(Normal, Right), wrong: &Wrong| {
            let reduced = Reduced::of(normal, right, &wrong.0);
            match nuisances {
                Nuisances::Move => reduced.here,
                Nuisances::Stay => reduced.misfit,
            }
        };
        let mut best = misfit(&here, &wrong);
        let steps = match nuisances {
            Nuisances::Move => STEPS,
            Nuisances::Stay => SKETCH_STEPS,
        };
        let mut damping = 0.0;
        for _ in 0..steps {
            // Held back until it helps: the model is not linear.
            let mut better = None;
            for _ in 0..TRIES {
                let reduced = Reduced::damped(&here.0, &here.1, &wrong.0, damping);
                let mut step = DVector::zeros(places.len());
                if let Some((found, covariance)) = reduced.solved_damped(&reach, damping) {
                    if damping == 0.0 {
                        errors = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
                    }
                    step = found;
                }
                let aside = match nuisances {
                    Nuisances::Move => reduced.nuisances(&step),
                    Nuisances::Stay => DVector::zeros(wrong.0.len()),
                };
                let tried = moved(&values, &step);
                let tried_wrong = Wrong(&wrong.0 + &aside);
                let there = self.linear(&tried, &tried_wrong, places, choose);
                let left = misfit(&there, &tried_wrong);
                if left < best {
                    better = Some((tried, tried_wrong, there, left));
                    damping = if damping < 1.0 { 0.0 } else { damping / 5.0 };
                    break;
                }
                damping = (damping * 5.0).max(0.5);
            }
            let Some((tried, tried_wrong, there, left)) = better else {
                break;
            };
            let gained = best - left;
            (values, wrong, here, best) = (tried, tried_wrong, there, left);
            if gained < CLOSE {
                break;
            }
        }
        Fit {
            values,
            wrong,
            errors,
            misfit: best,
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
