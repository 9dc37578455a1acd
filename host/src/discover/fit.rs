//! Effects fitted to the residuals, with the nuisances taken out.

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use nalgebra::DVector;
use rayon::prelude::*;

use super::design::{Around, Part, Place, places_of};
use super::flown::{COARSE, Prepared};
use super::linear::{Normal, Reduced, Right, sum};
use super::stretch::Channels;
use super::tolerance::Wrong;
use super::track::Track;

/// Steps of Gauss and Newton until nothing changes, at most.
const STEPS: usize = 12;
const SKETCH_STEPS: usize = 5;

/// Problems that are set up around one fit, at most, and the gain from which on another one is worth it, also as a
/// share of the misfit: of a fit that leaves much it need not be known how much.
const PROBLEMS: usize = 6;
/// The same for a fit that is kept: from afar it takes more.
const PROBLEMS_TO_THE_END: usize = 24;
const SETTLED: f64 = 3.0;
const SETTLED_SHARE: f64 = 0.001;

/// Times that a step is held back, at most.
const TRIES: usize = 5;

/// Gain that is as good as none, and as a share of the misfit.
const CLOSE: f64 = 0.2;
const CLOSE_SHARE: f64 = 0.0003;

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

/// Parameters of effects, each a column.
pub(super) fn columns(values: &Values) -> Vec<Place> {
    places_of(values.iter().map(|(effect, _)| *effect))
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

/// How a step is held back.
#[derive(Debug, Clone, Copy)]
enum Hold {
    /// Not at all.
    Free,
    /// To a share of it, which follows a curved valley.
    Shortened,
    /// By damping (Marquardt), which finds the way from afar.
    Damped(f64),
}

impl Hold {
    const fn share(self) -> f64 {
        match self {
            Self::Shortened => 0.3,
            _ => 1.0,
        }
    }

    const fn damping(self) -> f64 {
        match self {
            Self::Damped(damping) => damping,
            _ => 0.0,
        }
    }

    fn tighter(self) -> Self {
        match self {
            Self::Free => Self::Shortened,
            Self::Shortened => Self::Damped(0.5),
            Self::Damped(damping) => Self::Damped(5.0 * damping),
        }
    }

    fn looser(self) -> Self {
        match self {
            Self::Damped(damping) if damping >= 1.0 => Self::Damped(damping / 5.0),
            _ => Self::Free,
        }
    }
}

/// What joints and subject do while effects are fitted.
#[derive(Clone, Copy)]
enum Subject {
    /// They are fitted too.
    Moves,
    /// They act to first order where they stand.
    Stays,
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
                let flight = Prepared::new(self.track, stretch, &model, wrong, COARSE);
                let flown = flight.fly(&Channels::zeros());
                let white = block.residual(&flown);
                let columns = block.columns((&flight, &flown), self.model, (values, wrong), places);
                (
                    Normal::of(&columns, &block.nuisances),
                    Right::of(&white, &columns, &block.nuisances),
                )
            })
            .collect();
        let nothing = Normal::nothing(places.len(), wrong.0.len());
        let right = sum(
            Right::nothing(&nothing),
            parts.iter().map(|(_, right)| right),
        );
        (sum(nothing, parts.iter().map(|(normal, _)| normal)), right)
    }

    /// What a fit leaves, whitened, by stretch.
    pub fn residuals(&self, fit: &Fit) -> Vec<DVector<f64>> {
        let model = with(self.model, &fit.values);
        let residual = |(stretch, block): &Part| {
            let flight = Prepared::new(self.track, stretch, &model, &fit.wrong, COARSE);
            block.residual(&flight.fly(&Channels::zeros()))
        };
        self.around.parts.par_iter().map(residual).collect()
    }

    /// Effects as they are, with what joints and subject have wrong fitted beside them.
    pub fn settled(&self, values: &Values, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        self.minimised(values.clone(), &[], Subject::Moves, choose)
    }

    /// Fits the parameters of `values` from where they are, with joints and subject.
    pub fn fit(&self, values: Values, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        let places = columns(&values);
        self.minimised(values, &places, Subject::Moves, choose)
    }

    /// Fits them with joints and subject to first order: cheap, and it converges from afar.
    pub fn sketched(&self, values: Values) -> Fit {
        let places = columns(&values);
        self.minimised(values, &places, Subject::Stays, |_| true)
    }

    /// Fits in the problem around each fit, until that changes nothing, or cannot bring the misfit to `goal`.
    pub fn refined(&self, fit: Fit, goal: f64) -> (Fit, Around) {
        let places = columns(&fit.values);
        self.refined_in(fit, &places, goal, PROBLEMS)
    }

    /// The same to the end: nothing else is to be named for what a fit from afar still gains.
    pub fn finished(&self, fit: Fit) -> Fit {
        let places = columns(&fit.values);
        let (fit, _) = self.refined_in(fit, &places, f64::INFINITY, PROBLEMS_TO_THE_END);
        fit
    }

    /// Effects as they are, joints and subject fitted in the problem around each fit.
    pub fn settled_refined(&self, values: &Values) -> (Fit, Around) {
        let fit = self.settled(values, |_| true);
        self.refined_in(fit, &[], f64::INFINITY, PROBLEMS)
    }

    fn refined_in(
        &self,
        mut fit: Fit,
        places: &[Place],
        goal: f64,
        problems: usize,
    ) -> (Fit, Around) {
        let mut around = self.moved_to(&fit.values, &fit.wrong, &[]);
        for problems_left in (0..problems).rev() {
            let before = fit.misfit;
            let there = self.with(&around);
            fit = there.minimised(fit.values, places, Subject::Moves, |_| true);
            let gained = before - fit.misfit;
            let settled = gained < SETTLED.max(SETTLED_SHARE * fit.misfit);
            let hopeless = fit.misfit - gained * problems_left as f64 > goal;
            if problems_left == 0 || settled || hopeless {
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
        subject: Subject,
        choose: impl Fn(usize) -> bool + Sync + Copy,
    ) -> Fit {
        let reach: Vec<f64> = places.iter().map(|place| reach(*place)).collect();
        let mut wrong = self.around.wrong.clone();
        let mut here = self.linear(&values, &wrong, places, choose);
        let mut errors = vec![f64::INFINITY; places.len()];
        let misfit = |(normal, right): &(Normal, Right), wrong: &Wrong| match subject {
            Subject::Moves => right.misfit(&wrong.0),
            Subject::Stays => Reduced::of(normal, right, &wrong.0).misfit,
        };
        let mut best = misfit(&here, &wrong);
        let steps = match subject {
            Subject::Moves => STEPS,
            Subject::Stays => SKETCH_STEPS,
        };
        let mut hold = Hold::Free;
        for _ in 0..steps {
            let free = Reduced::of(&here.0, &here.1, &wrong.0);
            let mut predicted = best - free.misfit;
            if let Some((step, covariance)) = free.solved(&reach) {
                errors = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
                predicted += step.dot(&free.slope);
            }
            if predicted < CLOSE.max(CLOSE_SHARE * best) {
                break;
            }
            // Held back until it helps: the model is not linear.
            let mut better = None;
            for _ in 0..TRIES {
                let reduced = Reduced::damped(&here.0, &here.1, &wrong.0, hold.damping());
                let step = reduced.solved_damped(&reach, hold.damping());
                let step = step.map_or_else(|| DVector::zeros(places.len()), |(step, _)| step);
                let aside = match subject {
                    Subject::Moves => reduced.nuisances(&step),
                    Subject::Stays => DVector::zeros(wrong.0.len()),
                };
                let tried = moved(&values, &(&step * hold.share()));
                let tried_wrong = Wrong(&wrong.0 + &aside * hold.share());
                let there = self.linear(&tried, &tried_wrong, places, choose);
                let left = misfit(&there, &tried_wrong);
                if left < best {
                    better = Some((tried, tried_wrong, there, left));
                    hold = hold.looser();
                    break;
                }
                hold = hold.tighter();
            }
            let Some(found) = better else {
                break;
            };
            (values, wrong, here, best) = found;
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
