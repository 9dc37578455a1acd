//! Fits the parameters of a description in simulated flights by Gauss-Newton steps.

use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::applied_load::factor::Factor;
use nalgebra::{DMatrix, DVector};

use crate::jacobian::finite_difference::residual;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::gauss_newton::Fitted;
use crate::likelihood::linear_fit::LinearFit;
use crate::likelihood::prior::subject_precision;
use crate::likelihood::schur::InformationForm;
use crate::shooting::simulator::{Simulator, Steps};
use crate::unmodelled::term::Group;

/// Steps of the finite differences: force (N), moment (N m), frequency (Hz), phase (rad).
const FORCE_STEP: f64 = 5.0;
const MOMENT_STEP: f64 = 1.0;
const FREQUENCY_STEP: f64 = 0.001;
const PHASE_STEP: f64 = 0.03;

/// Groups of loads.
pub(crate) type Groups = Vec<Group>;

/// All loads of these groups. Returns `None` if there are more than a model can hold.
pub(crate) fn loads(groups: &[Group]) -> Option<AppliedLoads<f64>> {
    let mut all = AppliedLoads::none();
    for load in groups.iter().flat_map(Group::loads) {
        all = all.with(load).ok()?;
    }
    Some(all)
}

/// A parameter of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Number {
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
                Kind::Moment => MOMENT_STEP,
                Kind::Force(_) => FORCE_STEP,
            },
            Self::Frequency(..) => FREQUENCY_STEP,
            Self::Phase(..) => PHASE_STEP,
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
pub(crate) fn numbers(groups: &[Group]) -> Vec<Number> {
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
fn around(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    groups: &[Group],
) -> Option<InformationForm> {
    let numbers = numbers(groups);
    let under = problem.under(&loads(groups)?);
    let others: Option<Vec<_>> = numbers
        .iter()
        .enumerate()
        .map(|(k, number)| {
            let size = number.step(groups);
            let mut step = DVector::zeros(numbers.len());
            step[k] = size;
            let mut model = fitted.point.model(&under.plain);
            model.applied = loads(&moved(groups, &numbers, &step))?;
            Some((model, size))
        })
        .collect();
    let others = others?;
    let point = &fitted.point;
    let base = point.model(&under.plain);
    let reduced = problem.reduced_around(fitted, point, |stretch| {
        let track = problem.track;
        let (joints, likely) = (point.joints_in(stretch), point.start_in(stretch));
        let prepared = Simulator::new(track, stretch, &base, &joints, Steps::Long);
        let flown = prepared.residual(&likely, None);
        let mut columns = DMatrix::zeros(stretch.grid.residuals(), others.len() + 1);
        for (k, (model, size)) in others.iter().enumerate() {
            let other = prepared.changed_to(model).residual(&likely, None);
            columns.set_column(k, &((&flown - other) / *size));
        }
        let residual = residual(track, stretch, &under.plain, point);
        columns.set_column(others.len(), &residual);
        Some(columns)
    })?;
    let columns: Vec<usize> = (0..numbers.len()).collect();
    let precision = subject_precision(&problem.prior.tolerances, &[]);
    InformationForm::joint(&[reduced], &columns, &precision)
}

/// Fits the groups in a flight and returns them with the covariance of their [numbers].
pub(crate) fn followed(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    groups: &[Group],
) -> Option<(Groups, DMatrix<f64>)> {
    let numbers = numbers(groups);
    let prior: Vec<f64> = numbers.iter().map(|number| number.prior()).collect();
    let still = DVector::zeros(numbers.len());
    let best = around(problem, fitted, groups)?;
    let (step, _) = best.solved(&prior, &still)?;
    let fit = Fitted {
        prior: &prior,
        around: |groups: &Groups| around(problem, fitted, groups),
        moved: |groups: &Groups, step: &DVector<f64>| moved(groups, &numbers, step),
        away: |_: &Groups| still.clone(),
    };
    let (groups, best) = fit.from(groups.to_vec(), best, step)?;
    let (_, covariance) = best.solved(&prior, &still)?;
    Some((groups, covariance))
}
