//! Ranks the effects of the library: each is tried in addition to those already named, on the fitted and on the
//! held-out flights.

use crate::named_effect::EffectSet;
use bodyflight_core::effect::Effect;
use bodyflight_core::tolerances::Tolerances;
use nalgebra::{DMatrix, DVector};

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::Hypothesis;
use crate::jacobian::effect_parameters::{
    ParameterId, all_parameters, freedom, moved, numbers, parameters_of,
};
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::gauss_newton::Fitted;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::{fixed_by, subject_precision};
use crate::likelihood::schur::InformationForm;
use crate::likelihood::variance_components::FittedErrors;
use crate::progress::{Progress, check};
use crate::shooting::stretch::WINDOW;

/// Flights with their errors fitted, given the effects named so far.
pub(crate) struct JointFit<'a> {
    /// Flights that effects are fitted to.
    pub fitted: Vec<(&'a FlightProblem<'a>, LinearFit)>,
    /// Flights held out.
    pub held_out: Vec<(&'a FlightProblem<'a>, LinearFit)>,
    /// The effects named so far.
    pub effects: EffectSet,
    /// Tolerances of subject and suit.
    pub tolerances: Tolerances,
}

/// Places of the parameters of some effects among the columns of all effects.
pub(crate) fn columns_of(effects: &EffectSet) -> Vec<usize> {
    let all = all_parameters();
    let wanted = parameters_of(effects.iter().map(|(effect, _)| *effect));
    let place = |id: &ParameterId| all.iter().position(|other| other == id);
    wanted.iter().filter_map(place).collect()
}

/// Precision of subject and suit, given the effects.
pub(crate) fn precision(tolerances: &Tolerances, effects: &EffectSet) -> DVector<f64> {
    subject_precision(tolerances, &fixed_by(effects))
}

impl<'a> JointFit<'a> {
    /// The fitted flights.
    pub(crate) fn flights(&self) -> Vec<(&'a FlightProblem<'a>, &LinearFit)> {
        let each = self.fitted.iter();
        each.map(|(problem, fitted)| (*problem, fitted)).collect()
    }

    /// A hypothesis with its gain after refitting: `self` has the flights without it, `with` those with it.
    ///
    /// What slopes and covariance gain is not the effect's: in wide joints, a muscle input that lessened what joints
    /// matter made flights more likely by 200 in which nothing was hidden. So `alike`, the log-likelihoods of the flights
    /// without the effect, but with the covariance found with it, count where they are larger.
    pub(crate) fn compared(
        &self,
        with: &JointFit<'_>,
        hypothesis: &Hypothesis,
        alike: &[f64],
    ) -> Hypothesis {
        let own = self.likelihoods().into_iter().enumerate();
        let without = own.map(|(k, own)| alike.get(k).map_or(own, |alike| alike.max(own)));
        let after = with.likelihoods();
        let mut gains: Vec<f64> = after.iter().zip(without).map(|(b, a)| b - a).collect();
        let gains_held_out = gains.split_off(self.fitted.len());
        Hypothesis {
            effects: with.effects.clone(),
            gain: gains.iter().sum(),
            gains_held_out,
            gain_without_refit: None,
            ..hypothesis.clone()
        }
    }

    /// Log-likelihood of each flight, the held-out ones last.
    pub(crate) fn likelihoods(&self) -> Vec<f64> {
        let flights = self.fitted.iter().chain(&self.held_out);
        flights.map(|(_, fit)| fit.errors.likelihood).collect()
    }

    /// By how much each flight is more likely than before.
    pub(crate) fn gained_since(&self, before: &[f64]) -> Vec<f64> {
        let now = self.likelihoods().into_iter();
        now.zip(before).map(|(now, before)| now - before).collect()
    }

    /// The same hypothesis, with its gain in these flights without a refit if the name depends on the errors of refits.
    pub(crate) fn checked_without_refit(
        &self,
        hypothesis: Hypothesis,
        progress: &dyn Progress,
    ) -> Hypothesis {
        if !hypothesis.hinges_on_refits() {
            return hypothesis;
        }
        let other = self.followed(&hypothesis.effects, hypothesis.effect, progress);
        Hypothesis {
            gain_without_refit: other.map(|other| other.whole_gain()),
            ..hypothesis
        }
    }

    /// Errors of the fitted flights without unknown forces and moments.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn without_wrench(
        &self,
        progress: &dyn Progress,
    ) -> Result<Option<Vec<FittedErrors>>> {
        let each = self.fitted.iter();
        each.map(|(problem, fitted)| fitted.without_wrench(&problem.prior, progress))
            .collect()
    }

    /// Duration of the fitted flights in which the body moves (s).
    pub(crate) fn moving_s(&self) -> f64 {
        let flights = self.fitted.iter().map(|(problem, _)| problem);
        let moving = flights.filter(|problem| !problem.track.is_still(DECISION.still_rad));
        let rows = moving.flat_map(|problem| problem.stretches.iter().map(|part| part.grid.rows));
        rows.sum::<usize>() as f64 * WINDOW
    }

    /// Whether the flights are too short to tell what acts on the body. Errors of sensors show in any motion.
    pub(crate) fn is_thin(&self) -> bool {
        self.moving_s() < DECISION.informative_s
    }

    /// Log-likelihood of the fitted flights.
    pub(crate) fn likelihood(&self) -> f64 {
        self.fitted
            .iter()
            .map(|(_, fit)| fit.errors.likelihood)
            .sum()
    }

    pub(crate) fn precision(&self, effects: &EffectSet) -> DVector<f64> {
        precision(&self.tolerances, effects)
    }

    /// Standard deviations of the parameters' prior.
    pub(crate) fn prior(effects: &EffectSet) -> Vec<f64> {
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        parameters.iter().map(|id| id.prior_deviation()).collect()
    }

    pub(crate) fn from_neutral(effects: &EffectSet) -> DVector<f64> {
        let neutral: EffectSet = effects.iter().map(|(e, _)| (*e, e.neutral())).collect();
        numbers(effects) - numbers(&neutral)
    }

    /// The fitted and the held-out flights with columns for all effects. Returns `None` if one cannot be simulated.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn all_effects(
        &self,
        progress: &dyn Progress,
    ) -> Result<Option<[Vec<DMatrix<f64>>; 2]>> {
        let of_flights = |flights: &[(&FlightProblem<'_>, LinearFit)]| {
            let each = flights.iter();
            each.map(|(problem, fitted)| problem.all_effects(fitted, progress).cloned())
                .collect::<Option<Vec<DMatrix<f64>>>>()
        };
        let flights = of_flights(&self.fitted).zip(of_flights(&self.held_out));
        check(progress)?;
        Ok(flights.map(|(here, there)| [here, there]))
    }

    /// The most promising effects, best first, without those in `out_of_question`.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn hypotheses(
        &self,
        out_of_question: &[Effect],
        progress: &dyn Progress,
    ) -> Result<Vec<Hypothesis>> {
        let Some([here, there]) = self.all_effects(progress)? else {
            return Ok(Vec::new());
        };
        let mut hypotheses: Vec<Hypothesis> = Effect::ALL
            .iter()
            .filter(|effect| !effect.is_random() && !out_of_question.contains(effect))
            .filter(|effect| !self.effects.iter().any(|(named, _)| named == *effect))
            .filter_map(|effect| self.sketched(*effect, &here, &there))
            .collect();
        hypotheses.sort_by(|a, b| b.score().total_cmp(&a.score()));
        let mut followed = Vec::new();
        for hypothesis in hypotheses.into_iter().take(DECISION.refined) {
            check(progress)?;
            // By chance, it gains half as much.
            if hypothesis.gain < freedom(hypothesis.effect) {
                followed.push(hypothesis);
                continue;
            }
            followed.push(
                self.followed(&hypothesis.effects, hypothesis.effect, progress)
                    .unwrap_or(hypothesis),
            );
        }
        check(progress)?;
        followed.sort_by(|a, b| b.score().total_cmp(&a.score()));
        Ok(followed)
    }

    /// First-order estimate of an effect.
    fn sketched(
        &self,
        effect: Effect,
        here: &[DMatrix<f64>],
        there: &[DMatrix<f64>],
    ) -> Option<Hypothesis> {
        let mut effects = self.effects.clone();
        effects.push((effect, effect.neutral()));
        let (known, columns) = (columns_of(&self.effects), columns_of(&effects));
        let before = self.precision(&self.effects);
        let precision = self.precision(&effects);
        let zero = DVector::zeros(known.len());
        let plain = InformationForm::joint(here, &known, &before)?;
        let problem = InformationForm::joint(here, &columns, &precision)?;
        let (step, covariance) =
            problem.solved(&Self::prior(&effects), &Self::from_neutral(&effects))?;
        let effects = moved(&effects, &step);
        let mut start = self.effects.clone();
        start.push((effect, effect.neutral()));
        let step = numbers(&effects) - numbers(&start);
        let known_step = step.rows(0, known.len()).into_owned();
        let plain_left = if known.is_empty() {
            plain.left(&zero)
        } else {
            plain.left(&known_step).min(plain.left(&zero))
        };
        let held_out = there.iter().map(|flight| {
            let flight = core::slice::from_ref(flight);
            let (plain, problem) = (
                InformationForm::joint(flight, &known, &before)?,
                InformationForm::joint(flight, &columns, &precision)?,
            );
            Some(plain.left(&zero) - problem.left(&step))
        });
        Some(Hypothesis {
            effect,
            gain: plain_left - problem.left(&step),
            gains_held_out: held_out.collect::<Option<Vec<_>>>()?,
            gain_without_refit: None,
            effects,
            covariance,
            tempering: 1.0,
        })
    }

    /// The quadratic approximation for the requested parameters around `effects`, in flights of one subject.
    pub(crate) fn around(
        &self,
        flights: &[&(&FlightProblem<'_>, LinearFit)],
        effects: &EffectSet,
        parameters: &[ParameterId],
        progress: &dyn Progress,
    ) -> Option<InformationForm> {
        let reduced: Option<Vec<DMatrix<f64>>> = flights
            .iter()
            .map(|(problem, fitted)| problem.around(fitted, effects, parameters, progress))
            .collect();
        let columns: Vec<usize> = (0..parameters.len()).collect();
        InformationForm::joint(&reduced?, &columns, &self.precision(effects))
    }

    /// Refines a first-order estimate by Gauss-Newton steps. Returns `None` if the simulation diverges or the search
    /// was cancelled.
    pub(crate) fn followed(
        &self,
        sketch: &EffectSet,
        effect: Effect,
        progress: &dyn Progress,
    ) -> Option<Hypothesis> {
        let here: Vec<_> = self.fitted.iter().collect();
        let parameters = parameters_of(sketch.iter().map(|(effect, _)| *effect));
        let prior = Self::prior(sketch);
        // Starts from zero, so that an estimate that overshoots is damped.
        let mut effects: EffectSet = self.effects.clone();
        if !effects.iter().any(|(known, _)| *known == effect) {
            effects.push((effect, effect.neutral()));
        }
        // For a fair comparison, the effects already named may also move without the new one.
        let plain = self.around(
            &here,
            &self.effects,
            &parameters_of(self.effects.iter().map(|(e, _)| *e)),
            progress,
        )?;
        let settled = plain.solved(
            &Self::prior(&self.effects),
            &Self::from_neutral(&self.effects),
        );
        let plain_left = match settled {
            Some((step, _)) if !step.is_empty() => plain.left(&step).min(0.5 * plain.square),
            _ => 0.5 * plain.square,
        };
        let best = self.around(&here, &effects, &parameters, progress)?;
        let mut step = numbers(sketch) - numbers(&effects);
        if step.norm() <= 0.0 {
            step = best.solved(&prior, &Self::from_neutral(&effects))?.0;
        }
        let fit = Fitted {
            prior: &prior,
            around: |effects: &EffectSet| self.around(&here, effects, &parameters, progress),
            moved,
            away: Self::from_neutral,
        };
        let (effects, best) = fit.from(effects, best, step)?;
        let (_, covariance) = best.solved(&prior, &Self::from_neutral(&effects))?;
        let held_out = self.held_out.iter().map(|flight| {
            let plain = self.around(&[flight], &self.effects, &[], progress)?;
            let found = self.around(&[flight], &effects, &[], progress)?;
            Some(0.5 * (plain.square - found.square))
        });
        Some(Hypothesis {
            effect,
            gain: plain_left - 0.5 * best.square,
            gains_held_out: held_out.collect::<Option<Vec<_>>>()?,
            gain_without_refit: None,
            effects,
            covariance,
            tempering: 1.0,
        })
    }
}
