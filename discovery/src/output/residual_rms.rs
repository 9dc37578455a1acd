//! The gap between simulation and measurement: by channel and stretch, before and after, in this flight and in held-out
//! flights.

use crate::named_effect::EffectSet;
use bodyflight_core::dynamics::Motion;
use nalgebra::DVector;
use rayon::prelude::*;
use serde::Serialize;

use crate::jacobian::finite_difference::residual;
use crate::jacobian::linearization_point::LinearizationPoint;
use crate::likelihood::flight_problem::FlightProblem;
use crate::likelihood::linear_fit::LinearFit;
use crate::shooting::stretch::{CHANNELS, Channels};

/// Root mean squares of the residuals by channel.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Gap {
    /// The model as given by the files.
    pub before: [f64; CHANNELS],
    /// With the named effects, and with joints and subject adjusted.
    pub after: [f64; CHANNELS],
    /// Expected from sensor noise and joint wander alone.
    pub floor: [f64; CHANNELS],
    /// Share of the gap above the floor that was closed, over all channels in units of their floor.
    pub closed_share: f64,
}

/// The disagreement in one stretch.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Spot {
    /// Start of the stretch (s).
    pub time_s: f64,
    /// Root mean square of each channel divided by its floor, for the model as given by the files.
    pub over_floor: [f64; CHANNELS],
    /// The same with effects, joints and subject adjusted.
    pub over_floor_after: [f64; CHANNELS],
    /// Mean speed (m/s).
    pub speed_mps: f64,
    /// Mean magnitude of the angular velocity (rad/s).
    pub turn_radps: f64,
    /// Mean height (m).
    pub height_m: f64,
}

/// Mean square of each channel.
fn mean_square(residuals: &[DVector<f64>]) -> Channels {
    let mut squares = Channels::zeros();
    let mut count = 0.0;
    for residual in residuals {
        for row in residual.as_slice().chunks_exact(CHANNELS) {
            squares += Channels::from_column_slice(row).map(|value| value * value);
            count += 1.0;
        }
    }
    squares / f64::max(count, 1.0)
}

/// Residuals at a point of linearization, over all stretches.
fn all_residuals(problem: &FlightProblem<'_>, point: &LinearizationPoint) -> Vec<DVector<f64>> {
    let of = |stretch| residual(problem.track, stretch, &problem.plain, point);
    problem.stretches.par_iter().map(of).collect()
}

/// Root-mean-square residual of each channel expected from the errors, without the constant errors of joints and
/// subject.
fn floor(fitted: &LinearFit) -> Channels {
    let each: Vec<DVector<f64>> = fitted
        .parts
        .par_iter()
        .filter_map(|part| {
            let lower = part.covariance(&fitted.errors.sizes)?.l();
            Some(DVector::from_iterator(
                lower.nrows(),
                lower.row_iter().map(|row| row.norm()),
            ))
        })
        .collect();
    mean_square(&each).map(f64::sqrt)
}

/// The gap of a flight with what was found, and its distribution over the flight.
pub fn gap(
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    effects: &EffectSet,
) -> (Gap, Vec<Spot>) {
    gap_from(problem, problem, fitted, effects)
}

/// The same if `files` holds the model as given by the files, and `problem` has additional loads.
pub fn gap_from(
    files: &FlightProblem<'_>,
    problem: &FlightProblem<'_>,
    fitted: &LinearFit,
    effects: &EffectSet,
) -> (Gap, Vec<Spot>) {
    let point = LinearizationPoint {
        effects: effects.clone(),
        ..fitted.errors.point(&fitted.point)
    };
    let before = all_residuals(files, &LinearizationPoint::files());
    let after = all_residuals(problem, &point);
    let floor = floor(fitted);
    let [squares_before, squares_after] = [&before, &after].map(|residuals| mean_square(residuals));
    let (mut open, mut left) = (0.0, 0.0);
    for channel in 0..CHANNELS {
        let least = floor[channel].powi(2).max(1e-18);
        open += (squares_before[channel] / least - 1.0).max(0.0);
        left += (squares_after[channel] / least - 1.0).max(0.0);
    }
    let gap = Gap {
        before: squares_before.map(f64::sqrt).into(),
        after: squares_after.map(f64::sqrt).into(),
        floor: floor.into(),
        closed_share: if open > 0.0 {
            (1.0 - left / open).max(0.0)
        } else {
            0.0
        },
    };
    let track = problem.track;
    let spots = problem.stretches.iter().zip(before.iter().zip(&after));
    let spots = spots.map(|(stretch, (before, after))| {
        let over = |residual: &DVector<f64>| -> [f64; CHANNELS] {
            let squares = mean_square(core::slice::from_ref(residual));
            squares.map(f64::sqrt).component_div(&floor).into()
        };
        let samples = &track.samples[stretch.first..stretch.first + stretch.grid.frames()];
        let mean = |value: &dyn Fn(&Motion<f64>) -> f64| {
            let values = samples.iter().map(|sample| value(&sample.motion));
            values.sum::<f64>() / samples.len() as f64
        };
        Spot {
            time_s: track.samples[stretch.first].time,
            over_floor: over(before),
            over_floor_after: over(after),
            speed_mps: mean(&|motion| motion.velocity.components.norm()),
            turn_radps: mean(&|motion| motion.angular_velocity.components.norm()),
            height_m: mean(&|motion| motion.position.components.z),
        }
    });
    let spots = spots.collect();
    (gap, spots)
}
