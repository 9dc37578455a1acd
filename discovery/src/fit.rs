//! Effects fitted to the residuals, with the nuisances taken out.

use bodyflight_core::effect::Model;
use nalgebra::DVector;
use rayon::prelude::*;

use super::effect_set::{EffectSet, ParameterId, extended, parameters_of};
use super::flown::{COARSE, Prepared};
use super::linearization::{Linearization, Part};
use super::normal_equations::{Marginalized, NormalMatrix, NormalVector, sum};
use super::nuisance::Nuisance;
use super::stretch::Channels;
use super::track::Track;

/// Steps of Gauss and Newton until nothing changes, at most.
const STEPS: usize = 12;
const SKETCH_STEPS: usize = 5;

/// Linearizations about one fit, at most, and the gain from which on another one is worth it, also as a
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

/// Effects fitted to some stretches.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The effects with their parameters.
    pub effects: EffectSet,
    /// What joints and subject have wrong beside them.
    pub nuisance: Nuisance,
    /// Standard errors, in the order of the parameters.
    pub errors: Vec<f64>,
    /// Misfit that is left.
    pub misfit: f64,
}

/// How a step is held back.
#[derive(Debug, Clone, Copy)]
enum StepControl {
    /// Not at all.
    Free,
    /// To a share of it, which follows a curved valley.
    Shortened,
    /// By damping (Marquardt), which finds the way from afar.
    Damped(f64),
}

impl StepControl {
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

impl Subject {
    /// Steps that are made, at most.
    const fn steps(self) -> usize {
        match self {
            Self::Moves => STEPS,
            Self::Stays => SKETCH_STEPS,
        }
    }
}

/// Parameters of a set, each a column.
pub(crate) fn set_parameters(effects: &EffectSet) -> Vec<ParameterId> {
    parameters_of(effects.iter().map(|(effect, _)| *effect))
}

/// A flight to fit to, with the problem linearized somewhere.
#[derive(Clone, Copy)]
pub struct Data<'a> {
    /// The flight.
    pub track: &'a Track,
    /// The plain model.
    pub model: &'a Model<f64>,
    /// The problem linearized about some effects.
    pub linearization: &'a Linearization,
}

impl<'a> Data<'a> {
    /// A flight, the plain model, and the problem linearized about some effects.
    pub const fn new(
        track: &'a Track,
        model: &'a Model<f64>,
        linearization: &'a Linearization,
    ) -> Self {
        Self {
            track,
            model,
            linearization,
        }
    }

    /// The same flight linearized about something else.
    pub const fn with(self, linearization: &'a Linearization) -> Self {
        Self {
            linearization,
            ..self
        }
    }

    /// The problem linearized about some effects, with columns for some parameters: what joints and subject have wrong acts
    /// differently in another model.
    pub fn linearized_at(
        &self,
        effects: &EffectSet,
        nuisance: &Nuisance,
        parameters: &[ParameterId],
    ) -> Linearization {
        let stretches = self
            .linearization
            .parts
            .iter()
            .map(|(stretch, _)| stretch.clone());
        let stretches = stretches.collect();
        Linearization::new(
            self.track,
            self.model,
            stretches,
            (effects, nuisance),
            parameters,
        )
    }

    /// The normal equations in some parameters and the nuisances, of the stretches that `choose` takes.
    fn normal_equations(
        &self,
        effects: &EffectSet,
        nuisance: &Nuisance,
        parameters: &[ParameterId],
        choose: impl Fn(usize) -> bool + Sync,
    ) -> (NormalMatrix, NormalVector) {
        let model = extended(self.model, effects);
        let parts: Vec<_> = self
            .linearization
            .parts
            .par_iter()
            .enumerate()
            .filter(|(k, _)| choose(*k))
            .map(|(_, (stretch, block))| {
                let flight = Prepared::new(self.track, stretch, &model, nuisance, COARSE);
                let flown = flight.fly(&Channels::zeros());
                let white = block.residual(&flown);
                let columns = block.columns(
                    (&flight, &flown),
                    self.model,
                    (effects, nuisance),
                    parameters,
                );
                (
                    NormalMatrix::of(&columns, &block.nuisances),
                    NormalVector::of(&white, &columns, &block.nuisances),
                )
            })
            .collect();
        let nothing = NormalMatrix::nothing(parameters.len(), nuisance.0.len());
        let vector = sum(
            NormalVector::nothing(&nothing),
            parts.iter().map(|(_, vector)| vector),
        );
        (sum(nothing, parts.iter().map(|(matrix, _)| matrix)), vector)
    }

    /// What a fit leaves, whitened, by stretch.
    pub fn residuals(&self, fit: &Fit) -> Vec<DVector<f64>> {
        let model = extended(self.model, &fit.effects);
        let residual = |(stretch, block): &Part| {
            let flight = Prepared::new(self.track, stretch, &model, &fit.nuisance, COARSE);
            block.residual(&flight.fly(&Channels::zeros()))
        };
        self.linearization.parts.par_iter().map(residual).collect()
    }

    /// Effects as they are, with what joints and subject have wrong fitted beside them.
    pub fn profiled(
        &self,
        effects: &EffectSet,
        choose: impl Fn(usize) -> bool + Sync + Copy,
    ) -> Fit {
        self.minimised(effects.clone(), &[], Subject::Moves, choose)
    }

    /// Fits the parameters of `effects` from where they are, with joints and subject.
    pub fn fit(&self, effects: EffectSet, choose: impl Fn(usize) -> bool + Sync + Copy) -> Fit {
        let parameters = set_parameters(&effects);
        self.minimised(effects, &parameters, Subject::Moves, choose)
    }

    /// Fits them with joints and subject to first order: cheap, and it converges from afar.
    pub fn sketched(&self, effects: EffectSet) -> Fit {
        let parameters = set_parameters(&effects);
        self.minimised(effects, &parameters, Subject::Stays, |_| true)
    }

    /// Fits in the problem linearized about each fit, until that changes nothing, or cannot bring the misfit to `goal`.
    pub fn relinearized(&self, fit: Fit, goal: f64) -> (Fit, Linearization) {
        let parameters = set_parameters(&fit.effects);
        self.relinearized_in(fit, &parameters, goal, PROBLEMS)
    }

    /// The same to the end: nothing else is to be named for what a fit from afar still gains.
    pub fn relinearized_to_the_end(&self, fit: Fit) -> Fit {
        let parameters = set_parameters(&fit.effects);
        let (fit, _) = self.relinearized_in(fit, &parameters, f64::INFINITY, PROBLEMS_TO_THE_END);
        fit
    }

    /// Effects as they are, joints and subject fitted in the problem linearized about each fit: the profile
    /// likelihood of the effects.
    pub fn profiled_relinearized(&self, effects: &EffectSet) -> (Fit, Linearization) {
        let fit = self.profiled(effects, |_| true);
        self.relinearized_in(fit, &[], f64::INFINITY, PROBLEMS)
    }

    fn relinearized_in(
        &self,
        mut fit: Fit,
        parameters: &[ParameterId],
        goal: f64,
        problems: usize,
    ) -> (Fit, Linearization) {
        let mut linearization = self.linearized_at(&fit.effects, &fit.nuisance, &[]);
        for problems_left in (0..problems).rev() {
            let before = fit.misfit;
            let there = self.with(&linearization);
            fit = there.minimised(fit.effects, parameters, Subject::Moves, |_| true);
            let gained = before - fit.misfit;
            let settled = gained < SETTLED.max(SETTLED_SHARE * fit.misfit);
            let hopeless = fit.misfit - gained * problems_left as f64 > goal;
            if problems_left == 0 || settled || hopeless {
                break;
            }
            linearization = self.linearized_at(&fit.effects, &fit.nuisance, &[]);
        }
        (fit, linearization)
    }

    fn minimised(
        &self,
        effects: EffectSet,
        parameters: &[ParameterId],
        subject: Subject,
        choose: impl Fn(usize) -> bool + Sync + Copy,
    ) -> Fit {
        let problem = Minimisation {
            data: self,
            parameters,
            priors: parameters.iter().map(|id| id.prior_deviation()).collect(),
            subject,
            choose,
        };
        let mut here = problem.at(effects, self.linearization.nuisance.clone());
        let mut errors = vec![f64::INFINITY; parameters.len()];
        let mut control = StepControl::Free;
        for _ in 0..subject.steps() {
            let free = here.marginalized(0.0);
            let mut predicted = here.misfit - free.misfit;
            if let Some((step, covariance)) = free.solved(&problem.priors) {
                errors = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
                predicted += step.dot(&free.slope);
            }
            if predicted < CLOSE.max(CLOSE_SHARE * here.misfit) {
                break;
            }
            let Some(better) = problem.better(&here, &mut control) else {
                break;
            };
            here = better;
        }
        Fit {
            effects: here.effects,
            nuisance: here.nuisance,
            errors,
            misfit: here.misfit,
        }
    }
}

/// A misfit that is minimised in some parameters.
struct Minimisation<'a, C> {
    data: &'a Data<'a>,
    parameters: &'a [ParameterId],
    priors: Vec<f64>,
    subject: Subject,
    /// Stretches that take part.
    choose: C,
}

/// Where a minimisation stands, with the normal equations there.
struct Iterate {
    effects: EffectSet,
    nuisance: Nuisance,
    matrix: NormalMatrix,
    vector: NormalVector,
    misfit: f64,
}

impl Iterate {
    /// The nuisances taken out, held where they stand by `damping`.
    fn marginalized(&self, damping: f64) -> Marginalized {
        Marginalized::damped(&self.matrix, &self.vector, &self.nuisance.0, damping)
    }
}

impl<C: Fn(usize) -> bool + Sync + Copy> Minimisation<'_, C> {
    fn at(&self, effects: EffectSet, nuisance: Nuisance) -> Iterate {
        let (matrix, vector) =
            self.data
                .normal_equations(&effects, &nuisance, self.parameters, self.choose);
        let misfit = match self.subject {
            Subject::Moves => vector.misfit(&nuisance.0),
            Subject::Stays => Marginalized::of(&matrix, &vector, &nuisance.0).misfit,
        };
        Iterate {
            effects,
            nuisance,
            matrix,
            vector,
            misfit,
        }
    }

    /// The next iterate: the step is held back until it helps, for the model is not linear.
    fn better(&self, here: &Iterate, control: &mut StepControl) -> Option<Iterate> {
        for _ in 0..TRIES {
            let marginalized = here.marginalized(control.damping());
            let step = marginalized.solved_damped(&self.priors, control.damping());
            let step = step.map_or_else(|| DVector::zeros(self.parameters.len()), |(step, _)| step);
            let aside = match self.subject {
                Subject::Moves => marginalized.nuisances(&step),
                Subject::Stays => DVector::zeros(here.nuisance.0.len()),
            };
            let there = self.at(
                moved(&here.effects, &(&step * control.share())),
                Nuisance(&here.nuisance.0 + &aside * control.share()),
            );
            if there.misfit < here.misfit {
                *control = control.looser();
                return Some(there);
            }
            *control = control.tighter();
        }
        None
    }
}

/// Parameters after a step, inside their plausible ranges.
fn moved(effects: &EffectSet, step: &DVector<f64>) -> EffectSet {
    let mut steps = step.iter();
    effects
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
