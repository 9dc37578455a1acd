//! The data before the physics: what sensors say of one motion must fit together, whatever made it.
//!
//! Attitude changes as the angular velocity says, and position as the velocity says, in integral form over windows:
//! short ones for delays, long ones for biases and drifts. Delays, biases and drifts of the sensors that this needs
//! to hold are found here, to a precision that no physics adds to; where it holds without them they are out of the
//! question, and no physics is taken for them.

use bodyflight_core::dynamics::Motion;
use bodyflight_core::effect::sensors::Moving;
use bodyflight_core::effect::{Effect, PARAMETER_COUNT};
use bodyflight_core::frame::Vector;
use nalgebra::{DMatrix, DVector, SVector, UnitQuaternion, Vector3};
use serde::Serialize;

use super::effect_set::ParameterId;
use super::motion_history::MotionHistory;
use super::track::Track;

/// Frames of windows: half a second and five.
const WINDOWS: [usize; 2] = [120, 1200];

/// Frames on both sides that are averaged, of everything alike: what sensors say fits together after that as before,
/// and what a delay changes is seen above the noise.
const HALF_SMOOTHING: usize = 12;

/// Steps of Gauss and Newton.
const STEPS: usize = 8;

/// Deviations from which on an error of a sensor is one.
const SIGNIFICANT: f64 = 6.0;

/// Share of half the plausible range below which an error does not matter, and within which it must be known to be out
/// of the question.
const IMMATERIAL: f64 = 0.02;

/// What a check came to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Finding {
    /// The sensor has the error.
    Found,
    /// It has not, or so little that it does not matter.
    Absent,
    /// The flight does not tell.
    Undecided,
}

/// An error of a sensor, judged by the data alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Check {
    /// Which.
    pub effect: Effect,
    /// What came of it.
    pub finding: Finding,
    /// Its parameters.
    pub values: [f64; PARAMETER_COUNT],
    /// Their standard errors.
    pub errors: [f64; PARAMETER_COUNT],
    /// Largest parameter in its standard errors.
    pub deviations: f64,
}

/// Parameters of [`turns`].
const BIAS: [usize; 3] = [0, 1, 2];
const LAG: usize = 3;
const DRIFT: usize = 4;

/// Parameters of [`moves`]: a constant difference, which is no delay, and the delay.
const CONSTANT: [usize; 3] = [0, 1, 2];
const LATENCY: usize = 3;

/// All checks of a flight; none where it is too short for them.
pub fn checks(track: &Track) -> Vec<Check> {
    let history = &history(track);
    let turns = |window: usize, p: &Parameters| turns(track, history, window, p);
    let moves = |window: usize, p: &Parameters| moves(track, history, window, p);
    let mut checks = Vec::new();
    checks.extend(turning_checks(&turns).into_iter().flatten());
    if let Some(fit) = solved(&[&CONSTANT[..], &[LATENCY]].concat(), moves) {
        checks.push(fit.check(Effect::GnssLatency, &[LATENCY]));
    }
    checks
}

/// Bias, lag and drift. Belly to earth a drift of the heading is nearly a bias about one axis: where both together do
/// not tell, each is tried alone.
fn turning_checks(turns: &impl Fn(usize, &Parameters) -> DVector<f64>) -> Option<[Check; 3]> {
    let both = solved(&[&BIAS[..], &[LAG, DRIFT]].concat(), turns)?;
    let biased = solved(&[&BIAS[..], &[LAG]].concat(), turns)?;
    let drifting = solved(&[LAG, DRIFT], turns)?;
    let neither = solved(&[LAG], turns)?;
    let lag = both.check(Effect::RateLag, &[LAG]);
    let [bias, drift] = [
        both.check(Effect::GyroBias, &BIAS),
        both.check(Effect::HeadingDrift, &[DRIFT]),
    ];
    if bias.finding != Finding::Undecided && drift.finding != Finding::Undecided {
        return Some([bias, lag, drift]);
    }
    let misfit = |fit: &Solved| fit.misfit(&both.weights, turns);
    let [with_bias, with_drift] = [misfit(&biased), misfit(&drifting)];
    let alone = [
        biased.check(Effect::GyroBias, &BIAS),
        drifting.check(Effect::HeadingDrift, &[DRIFT]),
    ];
    let least = SIGNIFICANT * SIGNIFICANT;
    let [bias, drift] = if misfit(&neither) - with_bias.min(with_drift) < least {
        alone.map(Check::ruled_out)
    } else if with_drift - with_bias > least {
        [alone[0], alone[1].ruled_out()]
    } else if with_bias - with_drift > least {
        [alone[0].ruled_out(), alone[1]]
    } else {
        [bias, drift]
    };
    Some([bias, lag, drift])
}

impl Check {
    fn ruled_out(self) -> Self {
        Self {
            finding: Finding::Absent,
            values: self.effect.neutral(),
            deviations: 0.0,
            ..self
        }
    }
}

/// Numbers of which some are fitted; the others are zero.
type Parameters = SVector<f64, 5>;

/// Weights of residuals by length of the window and axis.
type Weights = [[f64; AXES]; WINDOWS.len()];

const AXES: usize = 3;

/// Parameters with their covariance.
struct Solved {
    values: Parameters,
    errors: Parameters,
    weights: Weights,
}

impl Solved {
    fn misfit(
        &self,
        weights: &Weights,
        residuals: &impl Fn(usize, &Parameters) -> DVector<f64>,
    ) -> f64 {
        let parts = WINDOWS.iter().zip(weights).map(|(window, weights)| {
            let left = residuals(*window, &self.values);
            let squares = left.iter().enumerate();
            squares
                .map(|(row, value)| value * value * weights[row % AXES])
                .sum::<f64>()
        });
        parts.sum()
    }

    fn check(&self, effect: Effect, places: &[usize]) -> Check {
        let mut check = Check {
            effect,
            finding: Finding::Absent,
            values: effect.neutral(),
            errors: [0.0; PARAMETER_COUNT],
            deviations: 0.0,
        };
        let (mut matters, mut vague) = (false, false);
        for (index, &place) in places.iter().enumerate() {
            let (value, error) = (self.values[place], self.errors[place]);
            let parameter = &effect.description().parameters[index];
            check.values[index] = value.clamp(parameter.low, parameter.high);
            check.errors[index] = error;
            let immaterial = IMMATERIAL * ParameterId { effect, index }.prior_deviation();
            matters |= value.abs() > SIGNIFICANT * error && value.abs() > immaterial;
            vague |= 3.0 * error > immaterial;
            check.deviations = check.deviations.max(value.abs() / error.max(1e-12));
        }
        check.finding = match (matters, vague) {
            (true, _) => Finding::Found,
            (false, true) => Finding::Undecided,
            (false, false) => Finding::Absent,
        };
        check
    }
}

/// Least squares of residuals in the `active` parameters, from zero. Residuals of one axis over windows of one length
/// weigh by what is left of them, and so do the errors.
fn solved(
    active: &[usize],
    residuals: impl Fn(usize, &Parameters) -> DVector<f64>,
) -> Option<Solved> {
    const DIFFERENCE: f64 = 1e-4;
    let count = active.len();
    let mut values = Parameters::zeros();
    let mut covariance = DMatrix::zeros(count, count);
    let mut weights = [[1.0; AXES]; WINDOWS.len()];
    for _ in 0..STEPS {
        let mut curvature = DMatrix::zeros(count, count);
        let mut slope = DVector::zeros(count);
        let mut parts = Vec::new();
        for (window, weights) in WINDOWS.into_iter().zip(weights) {
            let here = residuals(window, &values);
            let mut slopes = DMatrix::zeros(here.len(), count);
            for (column, &place) in active.iter().enumerate() {
                let mut there = values;
                there[place] += DIFFERENCE;
                let change = (residuals(window, &there) - &here) / DIFFERENCE;
                slopes.set_column(column, &change);
            }
            let heavy = DMatrix::from_fn(here.len(), count, |row, column| {
                slopes[(row, column)] * weights[row % AXES]
            });
            curvature += heavy.tr_mul(&slopes);
            slope += heavy.tr_mul(&here);
            parts.push((here, slopes));
        }
        // Enough of the short ones to know what is left.
        if parts.first().is_none_or(|(here, _)| here.len() < 4 * count) {
            return None;
        }
        let held = curvature.cholesky()?;
        let step = held.solve(&slope);
        for (weights, (here, slopes)) in weights.iter_mut().zip(&parts) {
            let left = here - slopes * &step;
            for (axis, weight) in weights.iter_mut().enumerate() {
                let own = left.iter().skip(axis).step_by(AXES);
                let (squares, rows) = own.fold((0.0, 0.0), |(s, n), e| (s + e * e, n + 1.0));
                *weight = rows / f64::max(squares, f64::MIN_POSITIVE);
            }
        }
        covariance = held.inverse();
        for (&place, step) in active.iter().zip(&step) {
            values[place] -= step;
        }
    }
    let mut errors = Parameters::zeros();
    for (column, &place) in active.iter().enumerate() {
        errors[place] = covariance[(column, column)].sqrt();
    }
    let known = values.iter().chain(&errors).all(|value| value.is_finite());
    known.then_some(Solved {
        values,
        errors,
        weights,
    })
}

/// Where windows begin.
fn windows(track: &Track, window: usize) -> impl Iterator<Item = usize> {
    let last = track
        .measured
        .len()
        .saturating_sub(window + HALF_SMOOTHING + 1);
    (HALF_SMOOTHING..last).step_by(window)
}

/// The mean of something small around a frame.
fn around(frame: usize, value: impl Fn(usize) -> Vector3<f64>) -> Vector3<f64> {
    let sum = (frame - HALF_SMOOTHING..=frame + HALF_SMOOTHING)
        .fold(Vector3::zeros(), |sum, k| sum + value(k));
    sum / (2 * HALF_SMOOTHING + 1) as f64
}

/// What is measured, averaged, over time.
fn history(track: &Track) -> MotionHistory {
    let moving: Vec<Moving<f64>> = track.measured.iter().map(Moving::of).collect();
    let mut history = MotionHistory::default();
    let last = moving.len().saturating_sub(HALF_SMOOTHING);
    for frame in HALF_SMOOTHING..last {
        history.push(
            track.times[frame],
            Moving {
                velocity: Vector::from_components(around(frame, |k| moving[k].velocity.components)),
                angular_velocity: Vector::from_components(around(frame, |k| {
                    moving[k].angular_velocity.components
                })),
            },
        );
    }
    history
}

/// Turn by the attitudes beyond that by the angular velocity less `[bias, bias, bias]`, measured `lag` late, with the
/// heading drifting at `drift`: parameters in this order.
fn turns(
    track: &Track,
    history: &MotionHistory,
    window: usize,
    parameters: &Parameters,
) -> DVector<f64> {
    let bias = parameters.fixed_rows::<3>(0).into_owned();
    let (lag, drift) = (parameters[LAG], parameters[DRIFT]);
    let start = track.times.first().copied().unwrap_or(0.0);
    let turn_of = |motion: &Motion<f64>| *motion.inertial_from_body.quaternion();
    // The mean of attitudes around a frame, with the drift taken off.
    let attitude = |frame: usize| {
        let centre = turn_of(&track.measured[frame]);
        let mean = around(frame, |k| {
            (centre.inverse() * turn_of(&track.measured[k])).scaled_axis()
        });
        let drifted = drift * (track.times[frame] - start);
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -drifted)
            * centre
            * UnitQuaternion::from_scaled_axis(mean)
    };
    let rows = windows(track, window).flat_map(|first| {
        let said = (first..first + window).fold(UnitQuaternion::identity(), |turn, k| {
            let [from, to] = [track.times[k], track.times[k + 1]];
            let middle = 0.5 * (from + to) + lag;
            let spin = history
                .at(middle)
                .map_or_else(Vector3::zeros, |moving| moving.angular_velocity.components);
            turn * UnitQuaternion::from_scaled_axis((spin - bias) * (to - from))
        });
        let turned = attitude(first).inverse() * attitude(first + window);
        let beyond = (said.inverse() * turned).scaled_axis();
        [beyond.x, beyond.y, beyond.z]
    });
    DVector::from_vec(rows.collect())
}

/// Way by the positions beyond that by the velocity less a constant, measured `latency` late: constant, latency.
fn moves(
    track: &Track,
    history: &MotionHistory,
    window: usize,
    parameters: &Parameters,
) -> DVector<f64> {
    let constant = parameters.fixed_rows::<3>(0).into_owned();
    let latency = parameters[LATENCY];
    let position = |frame: usize| around(frame, |k| track.measured[k].position.components);
    let rows = windows(track, window).flat_map(|first| {
        let said = (first..first + window).fold(Vector3::zeros(), |way, k| {
            let [from, to] = [track.times[k], track.times[k + 1]];
            let middle = 0.5 * (from + to) + latency;
            let velocity = history
                .at(middle)
                .map_or_else(Vector3::zeros, |moving| moving.velocity.components);
            way + (velocity - constant) * (to - from)
        });
        let beyond = position(first + window) - position(first) - said;
        [beyond.x, beyond.y, beyond.z]
    });
    DVector::from_vec(rows.collect())
}
