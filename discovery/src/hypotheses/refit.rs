//! Refits all errors together with an effect, and once more without it.

use crate::named_effect::EffectSet;
use bodyflight_core::tolerances::Tolerances;

use crate::error::Result;
use crate::hypotheses::decision::DECISION;
use crate::hypotheses::hypothesis::Hypothesis;
use crate::hypotheses::score_test::{JointFit, precision};
use crate::jacobian::effect_parameters::{between, furthest, moved, parameters_of};
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::schur::InformationForm;
use crate::likelihood::variance_components::FittedErrors;
use crate::progress::{Progress, check};

/// Maximum number of iterations with fixed slopes, the step at which they have converged (standard errors), and how
/// often the slopes are recomputed.
const FIXED_SLOPE_ROUNDS: usize = 8;
const SETTLED_EFFECTS: f64 = 0.4;
const SLOPES: usize = 6;

/// Change of the log-likelihood that justifies another step (or, for a loss, half a step), and how often a step is
/// halved.
const WORTH: f64 = 2.0;
const HALVED: usize = 3;

/// Initial strengths of an effect, relative to its first-order estimate: two around the constants with which the effect
/// was found, one around those of the flights without it.
const STARTS: [f64; 3] = [1.0, 2.2, 1.0];

/// Flights fitted around given effects.
pub(crate) struct GaussNewtonRound {
    pub(crate) fitted: Vec<LinearFit>,
    pub(crate) effects: EffectSet,
    /// Effects after the next step, and the size of that step (standard errors).
    next: EffectSet,
    moved: f64,
}

impl GaussNewtonRound {
    pub(crate) fn likelihood(&self) -> f64 {
        self.fitted.iter().map(|fit| fit.errors.likelihood).sum()
    }

    /// The more likely of two rounds. Likelihoods vary by a few units between points of linearization, so the last
    /// round is not always the best.
    fn or_likelier(self, other: Option<Self>) -> Self {
        match other {
            Some(other) if other.likelihood() > self.likelihood() => other,
            _ => self,
        }
    }

    /// The fitted errors with the effects of the next step.
    fn points(&self) -> Vec<LinearizationPoint> {
        let each = self.fitted.iter();
        each.map(|fitted| fitted.point_with(&self.next)).collect()
    }

    fn errors(&self) -> Vec<Option<&FittedErrors>> {
        self.fitted.iter().map(|fit| Some(&fit.errors)).collect()
    }
}

/// Flights that are fitted together, again and again with other effects.
pub(crate) struct Refit<'a> {
    pub(crate) problems: &'a [FlightProblem<'a>],
    /// Number of fitted flights; the others are held out.
    pub(crate) count: usize,
    pub(crate) tolerances: Tolerances,
    pub(crate) progress: &'a dyn Progress,
}

impl<'a> Refit<'a> {
    /// The flights with these fits, the held-out ones last.
    pub(crate) fn joint_fit(&self, mut fitted: Vec<LinearFit>, effects: EffectSet) -> JointFit<'a> {
        let held_out = fitted.split_off(self.count);
        let (here, there) = self.problems.split_at(self.count);
        JointFit {
            fitted: here.iter().zip(fitted).collect(),
            held_out: there.iter().zip(held_out).collect(),
            effects,
            tolerances: self.tolerances,
        }
    }

    /// Flights with the same effects and errors, linearized around the values in the files. Returns `None` if a simulation
    /// diverges.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn around_files(&self, own: &JointFit<'a>) -> Result<Option<JointFit<'a>>> {
        let files = LinearizationPoint::files_with(&own.effects);
        let mut all = Vec::new();
        for (problem, fitted) in own.fitted.iter().chain(&own.held_out) {
            let Some(fit) = problem.fit(&files, fitted.plausible_errors(), 1, self.progress)?
            else {
                return Ok(None);
            };
            all.push(fit);
        }
        Ok(Some(self.joint_fit(all, own.effects.clone())))
    }

    /// Refits everything together with a candidate. `from` is the scene in which it was found.
    ///
    /// Constants may absorb most of an effect, and a fit that starts from a weak effect may end in that local minimum.
    /// A stronger start is therefore tried too.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn with(
        &self,
        joint_fit: &JointFit<'a>,
        from: &JointFit<'a>,
        hypothesis: &Hypothesis,
    ) -> Result<Option<JointFit<'a>>> {
        let mut best: Option<GaussNewtonRound> = None;
        for (share, from) in STARTS.into_iter().zip([from, from, joint_fit]) {
            let start = hypothesis.stretched(share);
            let points: Vec<LinearizationPoint> = from
                .fitted
                .iter()
                .map(|(_, fitted)| fitted.start_with(&start))
                .collect();
            let first = match &best {
                None => {
                    let alone = joint_fit.fitted.iter();
                    let errors = alone.map(|(_, fitted)| fitted.plausible_errors());
                    self.fitted(&points, &errors.collect::<Vec<_>>())?
                }
                Some(best) => self.fitted_with_slopes(&best.fitted, &points)?,
            };
            let Some(first) = first else {
                continue;
            };
            let round = self.with_same_slopes(self.round(first, start)?)?;
            if best
                .as_ref()
                .is_none_or(|best| round.likelihood() > best.likelihood())
            {
                best = Some(round);
            }
        }
        let Some(round) = best else {
            return Ok(None);
        };
        let (fitted, effects) = self.with_new_slopes(round)?;
        self.with_held_out(fitted, joint_fit, effects)
    }

    /// The scene of fitted flights and effects, with the held-out flights of `before` fitted beside these effects.
    pub(crate) fn with_held_out(
        &self,
        mut fitted: Vec<LinearFit>,
        before: &JointFit<'a>,
        effects: EffectSet,
    ) -> Result<Option<JointFit<'a>>> {
        for (problem, alone) in &before.held_out {
            let Some(fit) = self.held_out_beside(problem, alone, &effects)? else {
                return Ok(None);
            };
            fitted.push(fit);
        }
        Ok(Some(self.joint_fit(fitted, effects)))
    }

    /// Fits the errors of a held-out flight together with given effects.
    ///
    /// Constants fitted without the effects may have absorbed part of them, and the constants of the files may be far
    /// from those of the flight. Both starts are tried, and the more likely fit is kept.
    fn held_out_beside(
        &self,
        problem: &FlightProblem<'a>,
        alone: &LinearFit,
        effects: &EffectSet,
    ) -> Result<Option<LinearFit>> {
        let files = LinearizationPoint::files_with(effects);
        let starts = [
            problem.fit(&files, alone.plausible_errors(), 1, self.progress)?,
            problem.fit_with_slopes_of(alone, &alone.point_with(effects), self.progress)?,
        ];
        let mut best: Option<LinearFit> = None;
        for start in starts.into_iter().flatten() {
            let start = problem.settled(start, self.progress)?;
            let likelihood = start.errors.likelihood;
            if best
                .as_ref()
                .is_none_or(|best| likelihood > best.errors.likelihood)
            {
                best = Some(start);
            }
        }
        best.map(|best| problem.converged(best, self.progress))
            .transpose()
    }

    /// Fits errors and effects with recomputed slopes until both converge.
    pub(crate) fn with_new_slopes(
        &self,
        mut round: GaussNewtonRound,
    ) -> Result<(Vec<LinearFit>, EffectSet)> {
        for _ in 0..SLOPES {
            let Some(fitted) = self.fitted(&round.points(), &round.errors())? else {
                break;
            };
            round = self.round(fitted, round.next.clone())?;
            if round.moved < SETTLED_EFFECTS {
                break;
            }
            round = self.with_same_slopes(round)?;
        }
        let each = self.problems.iter().zip(round.fitted);
        let fitted = each.map(|(problem, fitted)| problem.converged(fitted, self.progress));
        Ok((fitted.collect::<Result<Vec<_>>>()?, round.effects))
    }

    pub(crate) fn fitted(
        &self,
        points: &[LinearizationPoint],
        errors: &[Option<&FittedErrors>],
    ) -> Result<Option<Vec<LinearFit>>> {
        let each = self.problems.iter().zip(points).zip(errors);
        each.map(|((problem, point), errors)| problem.fit(point, *errors, 1, self.progress))
            .collect()
    }

    fn fitted_with_slopes(
        &self,
        of: &[LinearFit],
        points: &[LinearizationPoint],
    ) -> Result<Option<Vec<LinearFit>>> {
        let each = self.problems.iter().zip(of).zip(points);
        each.map(|((problem, of), point)| problem.fit_with_slopes_of(of, point, self.progress))
            .collect()
    }

    /// One Gauss-Newton step of the effects from a fit.
    pub(crate) fn round(
        &self,
        fitted: Vec<LinearFit>,
        effects: EffectSet,
    ) -> Result<GaussNewtonRound> {
        let parameters = parameters_of(effects.iter().map(|(effect, _)| *effect));
        let columns: Vec<usize> = (0..parameters.len()).collect();
        let precision = precision(&self.tolerances, &effects);
        let each = self.problems.iter().zip(&fitted);
        let reduced: Option<Vec<_>> = each
            .map(|(problem, fitted)| problem.slopes_here(fitted, &parameters, self.progress))
            .collect();
        check(self.progress)?;
        let solved = reduced
            .and_then(|reduced| InformationForm::joint(&reduced, &columns, &precision))
            .and_then(|here| {
                here.solved(
                    &JointFit::prior(&effects),
                    &JointFit::from_neutral(&effects),
                )
            });
        let next = solved
            .as_ref()
            .map_or_else(|| effects.clone(), |(step, _)| moved(&effects, step));
        Ok(GaussNewtonRound {
            moved: solved.map_or(0.0, |(_, covariance)| {
                furthest(&effects, &next, &covariance)
            }),
            fitted,
            effects,
            next,
        })
    }

    /// Fits errors and effects alternately, with fixed slopes, until both converge, and returns the most likely fit.
    pub(crate) fn with_same_slopes(&self, mut round: GaussNewtonRound) -> Result<GaussNewtonRound> {
        let (mut halved, mut gained) = (0, f64::INFINITY);
        let mut best = None;
        for _ in 0..FIXED_SLOPE_ROUNDS {
            // While an effect is still too weak, fitted errors and hence standard errors are large, so a small step
            // alone is no sign of convergence.
            if round.moved < SETTLED_EFFECTS && gained < WORTH {
                break;
            }
            let Some(fitted) = self.fitted_with_slopes(&round.fitted, &round.points())? else {
                break;
            };
            let next = self.round(fitted, round.next.clone())?;
            gained = next.likelihood() - round.likelihood();
            if gained < -WORTH && halved < HALVED {
                halved += 1;
                round.next = between(&round.effects, &round.next);
                continue;
            }
            halved = 0;
            best = Some(core::mem::replace(&mut round, next).or_likelier(best));
        }
        Ok(round.or_likelier(best))
    }

    /// Refits the flights `joint_fit` without an effect from the errors found with it, and then those with it, `next`, from
    /// the errors found without it, and so on, while more is gained than what is allowed for. Returns what the former gained,
    /// and the latter.
    ///
    /// Fits end in different minima, so each is given what the other found. What only one of them reached is not due to
    /// the effect: with joints that wander, a mass that was missing seemed to lose 65 because the flights without it alone
    /// were refitted.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn retried(
        &self,
        joint_fit: &mut JointFit<'a>,
        mut next: JointFit<'a>,
    ) -> Result<(f64, JointFit<'a>)> {
        let least = DECISION.refit_allowance();
        let mut gained = self.refitted_from(joint_fit, &next)?;
        if gained > least && self.refitted_from(&mut next, joint_fit)? > least {
            gained += self.refitted_from(joint_fit, &next)?;
        }
        Ok((gained, next))
    }

    /// A hypothesis with its gain after refitting, which is not that of the covariance: `joint_fit` has the flights without
    /// it, `with` those with it.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn compared(
        &self,
        joint_fit: &JointFit<'a>,
        with: &JointFit<'a>,
        hypothesis: &Hypothesis,
    ) -> Result<Hypothesis> {
        let alike = self.alike(joint_fit, with)?;
        Ok(joint_fit.compared(with, hypothesis, &alike))
    }

    /// Log-likelihood of each flight of `joint_fit` with its own effects, but with the slopes and the covariance of another
    /// fit.
    pub(crate) fn alike(&self, joint_fit: &JointFit<'a>, other: &JointFit<'a>) -> Result<Vec<f64>> {
        let effects = &joint_fit.effects;
        let each = other.fitted.iter().chain(&other.held_out);
        each.map(|(problem, other)| {
            let point = other.point_with(effects);
            let fit = problem.fit_with_slopes_of(other, &point, self.progress)?;
            let fit = fit.map(|fit| problem.settled(fit, self.progress));
            let likelihood = |fit: LinearFit| fit.errors.likelihood;
            Ok(fit.transpose()?.map_or(f64::NEG_INFINITY, likelihood))
        })
        .collect()
    }

    /// Refits flights with their own effects from the errors found with others where that makes them more likely, and
    /// returns the gain.
    ///
    /// # Errors
    /// Returns an error if the search was cancelled.
    pub(crate) fn refitted_from(
        &self,
        flights: &mut JointFit<'a>,
        other: &JointFit<'a>,
    ) -> Result<f64> {
        let mut gained = 0.0;
        let effects = flights.effects.clone();
        let each = flights.fitted.iter_mut().chain(&mut flights.held_out);
        for ((problem, own), (_, other)) in each.zip(other.fitted.iter().chain(&other.held_out)) {
            let point = other.point_with(&effects);
            let Some(again) = problem.fit(&point, Some(&other.errors), 1, self.progress)? else {
                continue;
            };
            let least = own.errors.likelihood;
            let again = problem.converged_above(least, again, self.progress)?;
            let gain = again.errors.likelihood - own.errors.likelihood;
            if gain > 0.0 {
                gained += gain;
                *own = again;
            }
        }
        Ok(gained)
    }
}
