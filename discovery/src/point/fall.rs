//! The free fall of a point: residuals of the model in windows, and effects fitted to them.

use bodyflight_core::body::pattern;
use bodyflight_core::dynamics::Dynamics;
use bodyflight_core::dynamics::point_mass::PointMass;
use bodyflight_core::effect::Model;
use nalgebra::{DMatrix, DVector, Vector3};

use super::candidate::{Candidate, Fit, effects_of};
use super::track::{Fix, Track};
use crate::effect_set::{EffectSet, extended};
use crate::error::{Error, Result};
use crate::normal_equations::{Marginalized, NormalMatrix, NormalVector, NuisanceColumns};
use crate::statistics::quantile;

/// Minimum speed of descent that counts as free fall (m/s).
pub(super) const FALLING: f64 = 15.0;

/// Minimum duration of a free fall (s).
const LEAST: f64 = 8.0;

/// Length of a window (s).
const WINDOW: f64 = 2.0;

/// Time for which the prior assumes a constant posture (s).
const POSTURE: f64 = 10.0;

/// Standard deviations of a posture's drag area (fraction) and of its lift in the two directions across the stream
/// (fraction of the weight).
const AREA_DEVIATION: f64 = 0.1;
const LIFT_DEVIATION: f64 = 0.05;

/// Standard deviation of what varies from one window to the next within a posture (fraction of the weight).
const JITTER: f64 = 0.01;

/// Minimum noise of a velocity (m/s).
const LEAST_NOISE: f64 = 0.03;

/// Maximum number of Gauss-Newton steps.
const STEPS: usize = 8;

/// A free fall with its model.
pub(super) struct Fall<'a> {
    pub(super) fixes: &'a [Fix],
    pub(super) plain: Model<f64>,
    /// Indices of the first and last fix of each window.
    pub(super) windows: Vec<(usize, usize)>,
    /// Standard deviation of one component of a velocity (m/s).
    pub(super) noise: f64,
    /// Derivatives with respect to the unknown posture, whitened.
    pub(super) nuisances: NuisanceColumns,
    /// Standard deviation of each row.
    pub(super) deviations: Vec<f64>,
}

/// The longest contiguous run of falling fixes.
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

/// Indices of the first and last fix of each window.
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

/// Derivatives of each window with respect to drag and lift of an unknown posture, along and across the stream, in
/// standard deviations of the rows; and these standard deviations, from noise (m/s) and jitter.
fn posture(
    fixes: &[Fix],
    windows: &[(usize, usize)],
    noise: f64,
    gravity: f64,
) -> (DMatrix<f64>, Vec<f64>) {
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "only a few postures"
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
    pub(super) fn new(track: &'a Track, dynamics: &dyn Fn(f64) -> Dynamics<f64>) -> Result<Self> {
        let fixes = falling(&track.fixes);
        let ends = fixes.first().zip(fixes.last());
        let duration = ends.map_or(0.0, |(first, last)| last.time - first.time);
        let Some((first, _)) = ends.filter(|_| duration >= LEAST) else {
            return Err(Error::NoFreeFall {
                least_s: LEAST,
                found_s: duration,
                descent_mps: FALLING,
            });
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

    pub(super) fn time(&self, window: usize) -> f64 {
        self.fixes[self.windows[window].0].time - self.fixes[0].time
    }

    pub(super) fn duration(&self) -> f64 {
        self.fixes[self.fixes.len() - 1].time - self.fixes[0].time
    }

    /// Change of velocity in each window that the model does not explain (m/s).
    pub(super) fn residuals(&self, effects: &EffectSet) -> Vec<Vector3<f64>> {
        let dynamics = extended(&self.plain, effects).dynamics;
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

    fn white(&self, effects: &EffectSet) -> DVector<f64> {
        let rows = self.residuals(effects);
        let white = rows
            .iter()
            .zip(&self.deviations)
            .flat_map(|(row, deviation)| {
                let row = row / *deviation;
                [row.x, row.y, row.z]
            });
        DVector::from_iterator(3 * rows.len(), white)
    }

    fn marginalized(&self, found: &[(Candidate, Vec<f64>)]) -> Marginalized {
        const DIFFERENCE: f64 = 1e-3;
        let effects = effects_of(found);
        let here = self.white(&effects);
        let mut columns = Vec::new();
        for (index, (candidate, numbers)) in found.iter().enumerate() {
            for number in 0..numbers.len() {
                let mut there = found.to_vec();
                let step = DIFFERENCE * candidate.prior_deviation();
                there[index].1[number] += step;
                columns.push((&here - self.white(&effects_of(&there))) / step);
            }
        }
        self.without_posture(&here, &DMatrix::from_columns(&columns))
    }

    fn without_posture(&self, white: &DVector<f64>, columns: &DMatrix<f64>) -> Marginalized {
        Marginalized::of(
            &NormalMatrix::of(columns, &self.nuisances),
            &NormalVector::of(white, columns, &self.nuisances),
            &DVector::zeros(self.nuisances.slopes().ncols()),
        )
    }

    /// Fits the effects, starting from their current values.
    pub(super) fn fit(&self, mut found: Vec<(Candidate, Vec<f64>)>) -> Fit {
        let priors: Vec<f64> = found
            .iter()
            .flat_map(|(candidate, numbers)| numbers.iter().map(|_| candidate.prior_deviation()))
            .collect();
        let mut errors = vec![f64::INFINITY; priors.len()];
        let mut marginalized = self.marginalized(&found);
        for _ in 0..STEPS {
            let Some((step, covariance)) = marginalized.solved(&priors) else {
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
            let again = self.marginalized(&there);
            if again.misfit >= marginalized.misfit {
                break;
            }
            let gained = marginalized.misfit - again.misfit;
            (found, marginalized) = (there, again);
            if gained < 0.01 {
                break;
            }
        }
        Fit {
            found,
            errors,
            misfit: marginalized.misfit,
        }
    }

    /// Misfit for fixed effects, with the posture marginalized out.
    pub(super) fn misfit(&self, effects: &EffectSet) -> f64 {
        let here = self.white(effects);
        let none = DMatrix::zeros(here.len(), 0);
        self.without_posture(&here, &none).misfit
    }

    pub(super) fn rows(&self) -> f64 {
        3.0 * self.windows.len() as f64
    }
}

/// Noise of one velocity component: the median residual of parabolas through four fixes each.
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
    // For a normal distribution the median is 0.6745 standard deviations; a third difference has twenty times the
    // variance.
    (middle / 0.6745 / 20.0_f64.sqrt()).max(LEAST_NOISE)
}
