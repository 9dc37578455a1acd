//! Discovery in recordings of a point: satellites see where a skydiver is and how fast, not the posture.
//!
//! The balance of momentum in integral form: over windows of two seconds the velocity changes by what gravity and
//! drag add up to along the way that was measured. Nothing is differentiated. Drag area and lift of an unknown
//! posture are nuisances, one draw for every ten seconds, so an effect gets a name only where it acts on the whole
//! flight. Effects that need no posture are tried: drag area, wind, density over the height.

mod report;

use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use nalgebra::{DMatrix, DVector, Vector3};

use super::choice::{SIGNIFICANT_ALONE, VOTE, deviations};
use super::fit::{Values, with};
use super::linear::{Normal, Nuisances, Reduced, Right};
use super::null::quantile;
use crate::diagnostic::{Problem, Result};
use crate::formats::flysight::{Fix, Track};
use report::Found;
pub use report::{COMPONENT_NAMES, Report, Spot};

/// Speed of descent of a free fall, at least (m/s).
const FALLING: f64 = 15.0;

/// Shortest free fall that is judged at all, and from which on names are given (s).
const LEAST: f64 = 8.0;
const ENOUGH: f64 = 20.0;

/// Length of a window (s).
const WINDOW: f64 = 2.0;

/// Time for which a posture is kept (s), as far as the prior goes.
const POSTURE: f64 = 10.0;

/// Deviations of the drag area of a posture (share) and of its lift across the stream, two axes (share of the weight).
const AREA_DEVIATION: f64 = 0.1;
const LIFT_DEVIATION: f64 = 0.05;

/// What is left of both from one window to the next (share of the weight).
const JITTER: f64 = 0.01;

/// Noise of a velocity, at least (m/s).
const LEAST_NOISE: f64 = 0.03;

/// Deviations from which on an effect is significant where other falls have a vote.
const SIGNIFICANT_WITH_VOTES: f64 = 4.5;

/// Steps of Gauss and Newton.
const STEPS: usize = 8;

/// An effect that needs no posture, and which of its parameters move together.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    effect: Effect,
    /// For each parameter of the effect, the number that sets it.
    ties: [usize; PARAMETER_COUNT],
    /// Numbers.
    count: usize,
}

/// Trunk, arms and legs cannot be told apart without a posture.
const CANDIDATES: [Candidate; 3] = [
    Candidate {
        effect: Effect::Drag,
        ties: [0, 0, 0],
        count: 1,
    },
    Candidate {
        effect: Effect::Wind,
        ties: [0, 1, 1],
        count: 2,
    },
    Candidate {
        effect: Effect::DensityGradient,
        ties: [0, 0, 0],
        count: 1,
    },
];

impl Candidate {
    /// Parameters of the effect for its numbers, inside their plausible ranges.
    fn values(&self, numbers: &[f64]) -> [f64; PARAMETER_COUNT] {
        let mut values = self.effect.neutral();
        let parameters = self.effect.description().parameters;
        for ((value, parameter), tie) in values.iter_mut().zip(parameters).zip(self.ties) {
            *value = numbers[tie].clamp(parameter.low, parameter.high);
        }
        values
    }

    fn neutral(&self) -> Vec<f64> {
        self.effect.neutral()[..self.count].to_vec()
    }

    /// Half of the plausible range: the prior.
    fn reach(&self) -> f64 {
        let parameter = &self.effect.description().parameters[0];
        0.5 * (parameter.high - parameter.low)
    }
}

/// A free fall with the model that is meant to fly it.
struct Fall<'a> {
    fixes: &'a [Fix],
    plain: Model<f64>,
    /// First and last fix of each window.
    windows: Vec<(usize, usize)>,
    /// Standard deviation of one component of a velocity (m/s).
    noise: f64,
    /// What an unknown posture may change, whitened.
    nuisances: Nuisances,
    /// Deviations of the rows.
    deviations: Vec<f64>,
}

/// The longest stretch of fixes that fall.
fn falling(fixes: &[Fix]) -> &[Fix] {
    let falls = |fix: &Fix| fix.velocity.components.z < -FALLING;
    let duration = |part: &[Fix]| match (part.first(), part.last()) {
        (Some(first), Some(last)) => last.time - first.time,
        _ => 0.0,
    };
    let parts = fixes.chunk_by(|a, b| falls(a) && falls(b) && b.time - a.time < WINDOW);
    parts
        .max_by(|a, b| duration(a).total_cmp(&duration(b)))
        .unwrap_or(&[])
}

/// First and last fix of each window.
fn windows(fixes: &[Fix]) -> Vec<(usize, usize)> {
    let mut windows = Vec::new();
    let mut begin = 0;
    for (index, fix) in fixes.iter().enumerate() {
        if fix.time - fixes[begin].time >= WINDOW {
            windows.push((begin, index));
            begin = index;
        }
    }
    windows
}

/// What lift and drag of an unknown posture change in each window, along and across the stream, in deviations of the
/// rows, and these: of noise (m/s) and jitter.
fn posture(
    fixes: &[Fix],
    windows: &[(usize, usize)],
    noise: f64,
    gravity: f64,
) -> (DMatrix<f64>, Vec<f64>) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a few postures"
    )]
    let posture_at = |fix: usize| ((fixes[fix].time - fixes[0].time) / POSTURE) as usize;
    let count = windows.last().map_or(0, |&(from, _)| posture_at(from)) + 1;
    let mut nuisances = DMatrix::zeros(3 * windows.len(), 3 * count);
    let mut deviations = Vec::new();
    for (k, &(from, to)) in windows.iter().enumerate() {
        let duration = fixes[to].time - fixes[from].time;
        let jitter = JITTER * gravity * duration;
        let deviation = (2.0 * noise * noise + jitter * jitter).sqrt();
        let stream = fixes[from].velocity.components.normalize();
        let aside = stream.cross(&Vector3::x()).normalize();
        let axes = [
            (stream, AREA_DEVIATION),
            (aside, LIFT_DEVIATION),
            (stream.cross(&aside), LIFT_DEVIATION),
        ];
        for (column, (axis, share)) in axes.into_iter().enumerate() {
            let change = axis * (share * gravity * duration / deviation);
            nuisances
                .fixed_view_mut::<3, 1>(3 * k, 3 * posture_at(from) + column)
                .copy_from(&change);
        }
        deviations.push(deviation);
    }
    (nuisances, deviations)
}

impl<'a> Fall<'a> {
    fn new(track: &'a Track, dynamics: &dyn Fn(f64) -> Dynamics<f64>) -> Result<Self> {
        let fixes = falling(&track.fixes);
        let ends = fixes.first().zip(fixes.last());
        let duration = ends.map_or(0.0, |(first, last)| last.time - first.time);
        let Some((first, _)) = ends.filter(|_| duration >= LEAST) else {
            return Err(Problem::bad_input(format!(
                "expected at least {LEAST} s of free fall, found {duration:.1} s"
            ))
            .help(format!(
                "a fall is where the descent is faster than {FALLING} m/s; a jump under an open canopy or on the ground has none"
            )));
        };
        let height = first.position.components.z;
        let plain = Model::new(dynamics(height), height);
        let (windows, noise) = (windows(fixes), noise(fixes));
        let (nuisances, deviations) = posture(fixes, &windows, noise, plain.dynamics.gravity);
        Ok(Self {
            fixes,
            plain,
            windows,
            noise,
            nuisances: nuisances.into(),
            deviations,
        })
    }

    fn time(&self, window: usize) -> f64 {
        self.fixes[self.windows[window].0].time - self.fixes[0].time
    }

    fn duration(&self) -> f64 {
        self.fixes[self.fixes.len() - 1].time - self.fixes[0].time
    }

    /// Change of velocity in each window beyond what the model adds up to (m/s).
    fn residuals(&self, values: &Values) -> Vec<Vector3<f64>> {
        let dynamics = with(&self.plain, values).dynamics;
        let point = PointMass::of(&dynamics, &pattern::neutral());
        let at = |fix: &Fix| point.acceleration(&fix.position, &fix.velocity).components;
        let residual = |&(from, to): &(usize, usize)| {
            let part = &self.fixes[from..=to];
            let steps = part
                .windows(2)
                .map(|pair| (at(&pair[0]) + at(&pair[1])) * (0.5 * (pair[1].time - pair[0].time)));
            let expected = steps.fold(Vector3::zeros(), |sum, step| sum + step);
            self.fixes[to].velocity.components - self.fixes[from].velocity.components - expected
        };
        self.windows.iter().map(residual).collect()
    }

    fn white(&self, values: &Values) -> DVector<f64> {
        let rows = self.residuals(values);
        let white = rows
            .iter()
            .zip(&self.deviations)
            .flat_map(|(row, deviation)| {
                let row = row / *deviation;
                [row.x, row.y, row.z]
            });
        DVector::from_iterator(3 * rows.len(), white)
    }

    fn reduced(&self, found: &[(Candidate, Vec<f64>)]) -> Reduced {
        const DIFFERENCE: f64 = 1e-3;
        let values = values_of(found);
        let here = self.white(&values);
        let mut columns = Vec::new();
        for (index, (candidate, numbers)) in found.iter().enumerate() {
            for number in 0..numbers.len() {
                let mut there = found.to_vec();
                let step = DIFFERENCE * candidate.reach();
                there[index].1[number] += step;
                columns.push((&here - self.white(&values_of(&there))) / step);
            }
        }
        self.without_posture(&here, &DMatrix::from_columns(&columns))
    }

    fn without_posture(&self, white: &DVector<f64>, columns: &DMatrix<f64>) -> Reduced {
        Reduced::of(
            &Normal::of(columns, &self.nuisances),
            &Right::of(white, columns, &self.nuisances),
            &DVector::zeros(self.nuisances.slopes().ncols()),
        )
    }

    /// Effects fitted from where they are: numbers, standard errors, misfit.
    fn fit(&self, mut found: Vec<(Candidate, Vec<f64>)>) -> Fit {
        let priors: Vec<f64> = found
            .iter()
            .flat_map(|(candidate, numbers)| numbers.iter().map(|_| candidate.reach()))
            .collect();
        let mut errors = vec![f64::INFINITY; priors.len()];
        let mut reduced = self.reduced(&found);
        for _ in 0..STEPS {
            let Some((step, covariance)) = reduced.solved(&priors) else {
                break;
            };
            errors = covariance.diagonal().iter().map(|v| v.sqrt()).collect();
            let mut there = found.clone();
            let mut steps = step.iter();
            for (candidate, numbers) in &mut there {
                for number in numbers.iter_mut() {
                    *number += steps.next().copied().unwrap_or(0.0);
                }
                let kept = candidate.values(numbers);
                numbers.copy_from_slice(&kept[..candidate.count]);
            }
            let again = self.reduced(&there);
            if again.misfit >= reduced.misfit {
                break;
            }
            let gained = reduced.misfit - again.misfit;
            (found, reduced) = (there, again);
            if gained < 0.01 {
                break;
            }
        }
        Fit {
            found,
            errors,
            misfit: reduced.misfit,
        }
    }

    /// Misfit of effects as they are, posture taken out.
    fn misfit(&self, values: &Values) -> f64 {
        let here = self.white(values);
        let none = DMatrix::zeros(here.len(), 0);
        self.without_posture(&here, &none).misfit
    }

    fn rows(&self) -> f64 {
        3.0 * self.windows.len() as f64
    }
}

/// Effects of the point, fitted.
#[derive(Clone)]
struct Fit {
    found: Vec<(Candidate, Vec<f64>)>,
    errors: Vec<f64>,
    misfit: f64,
}

fn values_of(found: &[(Candidate, Vec<f64>)]) -> Values {
    let values = |(candidate, numbers): &(Candidate, Vec<f64>)| {
        (candidate.effect, candidate.values(numbers))
    };
    found.iter().map(values).collect()
}

/// Noise of one component of a velocity: from what is left beside a parabola through four fixes, in the middle of all.
fn noise(fixes: &[Fix]) -> f64 {
    let velocity = |k: usize| fixes[k].velocity.components;
    let left: Vec<f64> = (3..fixes.len())
        .flat_map(|k| {
            let third =
                velocity(k) - velocity(k - 1) * 3.0 + velocity(k - 2) * 3.0 - velocity(k - 3);
            [third.x.abs(), third.y.abs(), third.z.abs()]
        })
        .collect();
    let middle = quantile(left, 0.5);
    // Of a normal distribution the median is 0.6745 deviations; the third difference has the variance of twenty.
    (middle / 0.6745 / 20.0_f64.sqrt()).max(LEAST_NOISE)
}

/// Looks for what the model of a point misses in the free fall of a recording.
///
/// `dynamics` is the model at the height at which the fall starts.
///
/// # Errors
/// Where there is no free fall that is long enough.
pub fn discover(
    track: &Track,
    held_out: &[Track],
    dynamics: &dyn Fn(f64) -> Dynamics<f64>,
    max_effects: usize,
) -> Result<Report> {
    let fall = Fall::new(track, dynamics)?;
    let others = held_out
        .iter()
        .map(|track| Fall::new(track, dynamics))
        .collect::<Result<Vec<_>>>()?;
    let plain = fall.misfit(&Values::new());
    let rows = fall.rows();
    let spread = (2.0 * rows).sqrt();
    let disagreement = (plain - rows) / spread;
    let mut chosen = Fit {
        found: Vec::new(),
        errors: Vec::new(),
        misfit: plain,
    };
    let mut gains: Vec<(Effect, f64, f64)> = Vec::new();
    while chosen.found.len() < max_effects.min(CANDIDATES.len()) {
        let known = |candidate: &&Candidate| {
            let own = |(found, _): &(Candidate, _)| found.effect == candidate.effect;
            !chosen.found.iter().any(own)
        };
        let tried = CANDIDATES.iter().filter(known).map(|candidate| {
            let mut found = chosen.found.clone();
            found.push((*candidate, candidate.neutral()));
            (candidate, fall.fit(found))
        });
        // Misfit that nothing explains makes chance larger.
        let best = tried.min_by(|a, b| a.1.misfit.total_cmp(&b.1.misfit));
        let Some((candidate, fit)) = best else {
            break;
        };
        let scale = (fit.misfit / rows).max(1.0);
        let freedom = candidate.count as f64;
        let score = deviations((chosen.misfit - fit.misfit) / scale, freedom);
        let votes = others.iter().map(|other| {
            let gain =
                other.misfit(&values_of(&chosen.found)) - other.misfit(&values_of(&fit.found));
            deviations(gain / scale, freedom)
        });
        let vetoed = votes.into_iter().any(|vote| vote < VOTE);
        let least = if others.is_empty() {
            SIGNIFICANT_ALONE
        } else {
            SIGNIFICANT_WITH_VOTES
        };
        if score < least || vetoed {
            break;
        }
        gains.push((candidate.effect, score, chosen.misfit - fit.misfit));
        chosen = fit;
    }
    let found = Found {
        chosen,
        gains,
        plain,
        disagreement,
    };
    Ok(Report::new(&fall, &others, track, found))
}

#[cfg(test)]
mod tests;
