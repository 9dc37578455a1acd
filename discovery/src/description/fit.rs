//! Fits the parameters of a description in simulated flights by Gauss-Newton steps.

use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::applied_load::factor::Factor;
use nalgebra::{DMatrix, DVector};

use super::group::Group;
use crate::error_prior::subject_precision;
use crate::fitted::Fitted;
use crate::linearization::missing;
use crate::prepared::{Prepared, Steps};
use crate::problem::Problem;
use crate::stretch::{Channels, NUMBERS};
use crate::whitened::Quadratic;

/// Maximum number of Gauss-Newton steps, and the gain of log-likelihood below which they stop.
const STEPS: usize = 5;
const SETTLED: f64 = 0.2;

/// Steps of the finite differences: force (N), moment (N m), frequency (Hz), phase (rad).
const FORCE: f64 = 5.0;
const MOMENT: f64 = 1.0;
const FREQUENCY: f64 = 0.001;
const PHASE: f64 = 0.03;

/// Groups of loads.
pub type Groups = Vec<Group>;

/// All loads of these groups. Returns `None` if there are more than a model can hold.
pub fn loads(groups: &[Group]) -> Option<AppliedLoads<f64>> {
    let mut all = AppliedLoads::none();
    for load in groups.iter().flat_map(Group::loads) {
        all = all.with(load).ok()?;
    }
    Some(all)
}

/// A parameter of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Number {
    /// Size of a load: indices of group and load.
    Size(usize, usize),
    /// Frequency of a factor: indices of group and factor.
    Frequency(usize, usize),
    /// Phase of that factor.
    Phase(usize, usize),
}

impl Number {
    fn of(self, groups: &mut [Group]) -> Option<&mut f64> {
        match self {
            Self::Size(group, term) => Some(&mut groups[group].terms[term].1),
            Self::Frequency(group, place) => match &mut groups[group].factors[place] {
                Some(Factor::Sine { frequency, .. }) => Some(frequency),
                _ => None,
            },
            Self::Phase(group, place) => match &mut groups[group].factors[place] {
                Some(Factor::Sine { phase, .. }) => Some(phase),
                _ => None,
            },
        }
    }

    fn step(self, groups: &[Group]) -> f64 {
        use bodyflight_core::dynamics::applied_load::Kind;
        match self {
            Self::Size(group, term) => match groups[group].terms[term].0.0 {
                Kind::Moment => MOMENT,
                Kind::Force(_) => FORCE,
            },
            Self::Frequency(..) => FREQUENCY,
            Self::Phase(..) => PHASE,
        }
    }

    /// Standard deviation of the prior, which is wide.
    const fn prior(self) -> f64 {
        match self {
            Self::Size(..) => 1000.0,
            Self::Frequency(..) => 0.1,
            Self::Phase(..) => 3.0,
        }
    }
}

/// The fitted parameters. Pulses keep the times found in the search.
pub fn numbers(groups: &[Group]) -> Vec<Number> {
    let mut all = Vec::new();
    for (g, group) in groups.iter().enumerate() {
        all.extend((0..group.terms.len()).map(|term| Number::Size(g, term)));
        for (place, factor) in group.factors.iter().enumerate() {
            if let Some(Factor::Sine { .. }) = factor {
                all.extend([Number::Frequency(g, place), Number::Phase(g, place)]);
            }
        }
    }
    all
}

/// Groups with their parameters moved by a step.
fn moved(groups: &[Group], numbers: &[Number], step: &DVector<f64>) -> Groups {
    let mut groups = groups.to_vec();
    for (number, step) in numbers.iter().zip(step.iter()) {
        if let Some(value) = number.of(&mut groups) {
            *value += step;
        }
    }
    groups
}

/// The quadratic approximation in the parameters of these groups.
fn around(problem: &Problem<'_>, fitted: &Fitted, groups: &[Group]) -> Option<Quadratic> {
    let numbers = numbers(groups);
    let under = problem.under(&loads(groups)?);
    let others: Option<Vec<_>> = numbers
        .iter()
        .enumerate()
        .map(|(k, number)| {
            let size = number.step(groups);
            let mut step = DVector::zeros(numbers.len());
            step[k] = size;
            let mut model = fitted.belief.model(&under.plain);
            model.applied = loads(&moved(groups, &numbers, &step))?;
            Some((model, size))
        })
        .collect();
    let others = others?;
    let belief = &fitted.belief;
    let base = belief.model(&under.plain);
    let reduced = problem.reduced_around(fitted, belief, |stretch| {
        let track = problem.track;
        let joints = belief.joints_in(stretch);
        let prepared = Prepared::new(track, stretch, &base, &joints, Steps::Long);
        let flown = prepared.fly(&Channels::zeros(), None);
        let mut columns = DMatrix::zeros(NUMBERS, others.len() + 1);
        for (k, (model, size)) in others.iter().enumerate() {
            let other = prepared.changed_to(model).fly(&Channels::zeros(), None);
            columns.set_column(k, &(other.less(&flown, track, stretch) / *size));
        }
        let missing = missing(track, stretch, &under.plain, belief);
        columns.set_column(others.len(), &missing);
        Some(columns)
    })?;
    let columns: Vec<usize> = (0..numbers.len()).collect();
    let precision = subject_precision(&problem.prior.tolerances, &[]);
    Quadratic::joint(&[reduced], &columns, &precision)
}

/// Fits the groups in a flight and returns them with the covariance of their [numbers].
pub fn followed(
    problem: &Problem<'_>,
    fitted: &Fitted,
    groups: &[Group],
) -> Option<(Groups, DMatrix<f64>)> {
    let numbers = numbers(groups);
    let prior: Vec<f64> = numbers.iter().map(|number| number.prior()).collect();
    let still = DVector::zeros(numbers.len());
    let mut groups = groups.to_vec();
    let mut best = around(problem, fitted, &groups)?;
    for _ in 0..STEPS {
        let (mut step, _) = best.solved(&prior, &still)?;
        let mut gained = None;
        for _ in 0..4 {
            let next = moved(&groups, &numbers, &step);
            if let Some(found) = around(problem, fitted, &next)
                && found.square < best.square
            {
                gained = Some(0.5 * (best.square - found.square));
                (groups, best) = (next, found);
                break;
            }
            step *= 0.5;
        }
        if gained.is_none_or(|gained| gained < SETTLED) {
            break;
        }
    }
    let (_, covariance) = best.solved(&prior, &still)?;
    Some((groups, covariance))
}
