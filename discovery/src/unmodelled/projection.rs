//! A flight as seen by the loads: what a force and a moment in each tenth of a second would gain, with everything that
//! suit, subject and sensors can explain removed. The gain of any load then takes a few sums.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::dynamics::applied_load::AppliedLoads;
use bodyflight_core::dynamics::applied_load::factor::Factor;
use bodyflight_core::dynamics::applied_load::instant::Instant;
use bodyflight_core::flight_sample::FlightSample;
use bodyflight_core::frame::Vector;
use bodyflight_core::{Posture, Segment};
use nalgebra::{Cholesky, DMatrix, DVector, Matrix6, Vector3, Vector6};
use rayon::prelude::*;

use crate::jacobian::linearization_point::CONSTANTS;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::shooting::stretch::ROWS;
use crate::unmodelled::grammar::{Factors, Pointing, unit};

/// Number of unknowns in a stretch: three components of force and three of moment in each window.
const UNKNOWNS: usize = 6 * ROWS;

/// Number of times within a window at which factors that depend on time are evaluated, for their mean.
const PARTS: u32 = 4;

/// A window: its middle (s, from the start of the flight), its length (s), and the state recorded in its middle.
struct Window {
    time: f64,
    length: f64,
    posture: Posture<f64>,
    motion: Motion<f64>,
    through_air: Vector3<f64>,
    cg: Vector3<f64>,
}

/// What a stretch reveals about an unknown force and moment in each of its windows.
struct Seen {
    windows: Vec<Window>,
    information: DMatrix<f64>,
    /// Coupling of the constants with these forces and moments, in standard deviations of the constants.
    constants: DMatrix<f64>,
    slope: DVector<f64>,
}

/// The information in a flight about forces and moments in its windows.
pub(crate) struct View<'a> {
    problem: &'a FlightProblem<'a>,
    stretches: Vec<Seen>,
}

/// Force and moment of a unit load in every window of a stretch, and their information.
struct Along {
    pushes: Vec<(Vector3<f64>, Vector3<f64>)>,
    information: Matrix6<f64>,
    slope: Vector6<f64>,
    constants: DMatrix<f64>,
}

/// A direction projected onto a view.
pub(crate) struct Directed {
    stretches: Vec<Along>,
}

/// A load as a column: a direction and a factor for each window.
pub(crate) struct Column<'a> {
    /// Direction of the load.
    pub along: &'a Directed,
    /// Factor for each window.
    pub values: &'a [f64],
}

impl<'a> View<'a> {
    /// Creates the view from a fit. Returns `None` if a covariance is not positive definite.
    pub(crate) fn new(problem: &'a FlightProblem<'a>, fitted: &LinearFit) -> Option<Self> {
        let errors = &fitted.errors;
        let each: Option<Vec<_>> = fitted
            .parts
            .par_iter()
            .map(|part| {
                let factor = part.covariance(&errors.sizes)?;
                let lower = factor.l_dirty();
                let mut pushes = DMatrix::zeros(part.residual.len(), UNKNOWNS);
                for (k, columns) in part.pushes.iter().enumerate() {
                    // Windows that a short stretch lacks reveal nothing.
                    pushes
                        .columns_mut(3 * ROWS * k, columns.ncols())
                        .copy_from(columns);
                }
                let mut constants = DMatrix::clone(&part.constants);
                let mut left = &part.residual - &*part.constants * &errors.constants;
                lower.solve_lower_triangular_mut(&mut pushes);
                lower.solve_lower_triangular_mut(&mut constants);
                lower.solve_lower_triangular_mut(&mut left);
                Some((
                    pushes.tr_mul(&pushes),
                    constants.tr_mul(&pushes),
                    pushes.tr_mul(&left),
                ))
            })
            .collect();
        // The covariance of the constants is the inverse of their information.
        let root = errors.covariance.clone().cholesky()?.l();
        let stretches = each?
            .into_par_iter()
            .zip(&problem.stretches)
            .map(|((information, constants, slope), stretch)| Seen {
                windows: windows(problem, stretch.first, stretch.grid.window),
                information,
                constants: root.tr_mul(&constants),
                slope,
            })
            .collect();
        Some(Self { problem, stretches })
    }

    /// Projects a direction onto the view.
    pub(crate) fn directed(&self, pointing: Pointing) -> Directed {
        let dynamics = &self.problem.plain.dynamics;
        let loads = AppliedLoads::none().with(unit(pointing, [None; 3]));
        let loads = loads.unwrap_or_else(|_| AppliedLoads::none());
        let along = |seen: &Seen| {
            let pushes: Vec<_> = seen
                .windows
                .iter()
                .map(|w| {
                    let cg = Vector::from_components(w.cg);
                    let push = loads.at(dynamics, &w.posture, &w.motion, &cg, w.time);
                    (push.force.components, push.moment.components)
                })
                .collect();
            let mut columns = DMatrix::zeros(UNKNOWNS, ROWS);
            for (row, (force, moment)) in pushes.iter().enumerate() {
                columns
                    .fixed_view_mut::<3, 1>(3 * row, row)
                    .copy_from(force);
                let below = 3 * (ROWS + row);
                columns.fixed_view_mut::<3, 1>(below, row).copy_from(moment);
            }
            let information = columns.tr_mul(&(&seen.information * &columns));
            let slope = columns.tr_mul(&seen.slope);
            Along {
                information: Matrix6::from_iterator(information.iter().copied()),
                slope: Vector6::from_iterator(slope.iter().copied()),
                constants: &seen.constants * &columns,
                pushes,
            }
        };
        Directed {
            stretches: self.stretches.par_iter().map(along).collect(),
        }
    }

    /// A product of factors, averaged over each window.
    pub(crate) fn values(&self, factors: &Factors) -> Vec<f64> {
        let changes =
            |factor: &Factor<f64>| matches!(factor, Factor::Sine { .. } | Factor::Pulse { .. });
        let parts = if factors.iter().flatten().any(changes) {
            PARTS
        } else {
            1
        };
        let value = |window: &Window| {
            let at = |part: u32| {
                let share = (f64::from(part) + 0.5) / f64::from(parts) - 0.5;
                let now = Instant {
                    time: window.time + share * window.length,
                    motion: &window.motion,
                    posture: &window.posture,
                    through_air: window.through_air,
                };
                let each = factors.iter().flatten();
                each.fold(1.0, |product, factor| product * factor.at(&now))
            };
            (0..parts).map(at).sum::<f64>() / f64::from(parts)
        };
        let windows = self.stretches.iter().flat_map(|seen| &seen.windows);
        windows.map(value).collect()
    }

    /// Gain of log-likelihood from several loads together, and the sizes that achieve it.
    pub(crate) fn solved(&self, columns: &[Column<'_>]) -> Option<(f64, DVector<f64>)> {
        let (information, slope) = self.quadratic(columns)?;
        let sizes = Cholesky::new(information)?.solve(&slope);
        Some((0.5 * sizes.dot(&slope), sizes))
    }

    /// Information and slope of some columns, with the constants marginalized out.
    pub(crate) fn quadratic(&self, columns: &[Column<'_>]) -> Option<(DMatrix<f64>, DVector<f64>)> {
        let count = columns.len();
        let mut information = DMatrix::zeros(count, count);
        let mut slope = DVector::zeros(count);
        let mut constants = DMatrix::zeros(CONSTANTS, count);
        for (s, seen) in self.stretches.iter().enumerate() {
            let mut pushes = DMatrix::zeros(UNKNOWNS, count);
            for (k, column) in columns.iter().enumerate() {
                let along = column.along.stretches.get(s)?;
                let values = column.values.get(s * ROWS..(s + 1) * ROWS)?;
                for (row, ((force, moment), value)) in along.pushes.iter().zip(values).enumerate() {
                    let mut part = pushes.fixed_view_mut::<3, 1>(3 * row, k);
                    part += force * *value;
                    let mut part = pushes.fixed_view_mut::<3, 1>(3 * (ROWS + row), k);
                    part += moment * *value;
                }
            }
            information += pushes.tr_mul(&(&seen.information * &pushes));
            slope += pushes.tr_mul(&seen.slope);
            constants += &seen.constants * pushes;
        }
        information -= constants.tr_mul(&constants);
        Some((information, slope))
    }

    /// A lower bound for the gain of one direction with one or two sets of values: marginalizing the constants, which
    /// this omits, can only increase it.
    pub(crate) fn at_least(&self, along: &Directed, values: [&[f64]; 2]) -> f64 {
        let (mut aa, mut ab, mut bb, mut sa, mut sb) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (s, part) in along.stretches.iter().enumerate() {
            let of = |values: &[f64]| {
                let here = values.get(s * ROWS..(s + 1) * ROWS).unwrap_or(&[]);
                Vector6::from_fn(|k, _| here.get(k).copied().unwrap_or(0.0))
            };
            let (a, b) = (of(values[0]), of(values[1]));
            let (pulled_a, pulled_b) = (part.information * a, part.information * b);
            aa += a.dot(&pulled_a);
            ab += b.dot(&pulled_a);
            bb += b.dot(&pulled_b);
            sa += a.dot(&part.slope);
            sb += b.dot(&part.slope);
        }
        let determinant = aa * bb - ab * ab;
        if determinant > 1e-9 * aa * bb {
            0.5 * (sa * sa * bb - 2.0 * sa * sb * ab + sb * sb * aa) / determinant
        } else if aa > 0.0 {
            0.5 * sa * sa / aa
        } else {
            0.0
        }
    }

    /// Gain of one direction with given values, with the constants marginalized out.
    pub(crate) fn gain(&self, along: &Directed, values: &[f64]) -> f64 {
        let (mut information, mut slope) = (0.0, 0.0);
        let mut constants = DVector::zeros(CONSTANTS);
        for (s, part) in along.stretches.iter().enumerate() {
            let here = values.get(s * ROWS..(s + 1) * ROWS).unwrap_or(&[]);
            let a = Vector6::from_fn(|k, _| here.get(k).copied().unwrap_or(0.0));
            information += a.dot(&(part.information * a));
            slope += a.dot(&part.slope);
            constants += &part.constants * a;
        }
        let left: f64 = information - constants.norm_squared();
        if left > 1e-6 * information {
            0.5 * slope * slope / left
        } else {
            0.0
        }
    }
}

/// The windows of a stretch.
fn windows(problem: &FlightProblem<'_>, first: usize, length: usize) -> Vec<Window> {
    let track = problem.track;
    let dynamics = &problem.plain.dynamics;
    let window = |row: usize| {
        let last = track.samples.len() - 1;
        let [from, to] = [row, row + 1].map(|row| (first + row * length).min(last));
        let middle = (from + length / 2).min(last);
        let FlightSample {
            posture, motion, ..
        } = track.samples[middle];
        let air = dynamics.air.velocity_at(&motion.position);
        let air = (motion.inertial_from_body.inverse() * air).components;
        Window {
            time: 0.5 * (track.samples[from].time + track.samples[to].time) - track.samples[0].time,
            length: track.samples[to].time - track.samples[from].time,
            through_air: motion.velocity.components - air,
            cg: dynamics.hold(&posture).mass.cg,
            posture,
            motion,
        }
    };
    (0..ROWS).map(window).collect()
}

/// Mean rotation of a joint over a flight (rad), the zero of factors that depend on it.
pub(crate) fn mean_turn(problem: &FlightProblem<'_>, segment: Segment) -> Vector3<f64> {
    let samples = &problem.track.samples;
    let sum: Vector3<f64> = samples
        .iter()
        .map(|sample| sample.posture.parent_from_segment(segment).scaled_axis())
        .sum();
    sum / samples.len().max(1) as f64
}
