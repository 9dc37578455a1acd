//! The factored covariance of the error coordinates: its start, its way over an interval, and its limits.
//!
//! The motion comes first and the inputs last, so the inputs' own covariance is the lower right corner of the factors
//! and only the nine rows of the motion must be made triangular again after an interval (Thornton's weighted
//! Gram-Schmidt). The inputs' noise is added one coordinate after another.

use nalgebra::SVector;

use super::process::Process;
use super::state::{
    ATTITUDE, INPUT_STATES, MOTION_STATES, MUSCLE, RESIDUAL_FORCE, RESIDUAL_MOMENT, SPIN, STATES,
    VELOCITY,
};
use super::transition::MotionSlope;
use crate::estimator::ud::Ud;
use crate::math::Real;

/// The covariance of the filter.
pub type Factors<T> = Ud<T, STATES>;

/// Columns that are made triangular: those of the motion, and the noise of velocity and angular velocity.
const COLUMNS: usize = MOTION_STATES + 6;

/// Smallest decay of an input over an interval by which its factors are divided.
const LEAST_DECAY: f64 = 1.0 / 64.0;

/// Standard deviations beyond which nothing is known: of the attitude (rad), of the velocity (m/s) and of the angular
/// velocity (rad/s), and of the residual force (m2) and moment (m3).
const UNKNOWN: [f32; 3] = [2.0, 50.0, 20.0];
const UNKNOWN_LOAD: [f32; 2] = [1.0, 0.5];

/// Propagates the factors over an interval, with its noise.
#[inline(never)]
pub fn cross<T: Real>(factors: &mut Factors<T>, slope: &MotionSlope<T>, process: &Process<T>) {
    let mut moving = [[T::zero(); COLUMNS]; MOTION_STATES];
    let mut weights = [T::zero(); COLUMNS];
    fly(factors, slope, &mut moving);
    decay(factors, process);
    for (k, weight) in weights.iter_mut().enumerate().take(MOTION_STATES) {
        *weight = factors.elements()[(k, k)];
    }
    let noise = process.motion_noise();
    for k in 0..6 {
        moving[VELOCITY + k][MOTION_STATES + k] = T::one();
        weights[MOTION_STATES + k] = noise[k / 3];
    }
    orthogonalise(factors, &mut moving, &weights);
    drive(factors, process);
}

/// Multiplies the rows of the motion by the slope: into `moving` for the columns of the motion, in place for those of
/// the inputs.
fn fly<T: Real>(
    factors: &mut Factors<T>,
    slope: &MotionSlope<T>,
    moving: &mut [[T; COLUMNS]; MOTION_STATES],
) {
    let elements = factors.elements_mut();
    for j in 0..STATES {
        let mut column = slope.column(j).into_owned();
        for k in 0..j {
            let unit = elements[(k, j)];
            for i in 0..MOTION_STATES {
                column[i] += slope[(i, k)] * unit;
            }
        }
        for i in 0..MOTION_STATES {
            if j < MOTION_STATES {
                moving[i][j] = column[i];
            } else {
                elements[(i, j)] = column[i];
            }
        }
    }
}

/// Lets the inputs decay: their rows are scaled, then each column again so that its unit stays one.
fn decay<T: Real>(factors: &mut Factors<T>, process: &Process<T>) {
    let least = T::of(LEAST_DECAY);
    let kept = process
        .decay()
        .map(|decay| if decay < least { least } else { decay });
    let elements = factors.elements_mut();
    for j in 0..INPUT_STATES {
        let column = MOTION_STATES + j;
        let inverse = T::one() / kept[j];
        for i in 0..MOTION_STATES {
            elements[(i, column)] *= inverse;
        }
        for i in 0..j {
            elements[(MOTION_STATES + i, column)] *= kept[i] * inverse;
        }
        elements[(column, column)] *= kept[j] * kept[j];
    }
}

/// Replaces the rows of the motion by triangular ones of the same weighted products.
fn orthogonalise<T: Real>(
    factors: &mut Factors<T>,
    moving: &mut [[T; COLUMNS]; MOTION_STATES],
    weights: &[T; COLUMNS],
) {
    let elements = factors.elements_mut();
    for j in (0..MOTION_STATES).rev() {
        let (above, rest) = moving.split_at_mut(j);
        let Some(row) = rest.first() else {
            return;
        };
        let mut weighted = [T::zero(); COLUMNS];
        let mut pivot = T::zero();
        for k in 0..COLUMNS {
            weighted[k] = row[k] * weights[k];
            pivot += row[k] * weighted[k];
        }
        elements[(j, j)] = pivot;
        let inverse = T::one() / pivot;
        for (i, other) in above.iter_mut().enumerate() {
            let mut product = T::zero();
            for k in 0..COLUMNS {
                product += other[k] * weighted[k];
            }
            let unit = product * inverse;
            elements[(i, j)] = unit;
            for k in 0..COLUMNS {
                other[k] -= unit * row[k];
            }
        }
    }
}

/// Adds the noise of the inputs.
fn drive<T: Real>(factors: &mut Factors<T>, process: &Process<T>) {
    for k in 0..6 {
        let noise = process.input_noise(k, factors.variance(MUSCLE + k));
        factors.add_to(MUSCLE + k, noise);
    }
    let residual = Ud::of(&process.residual_noise());
    for k in 0..6 {
        let mut direction = SVector::<T, STATES>::zeros();
        direction
            .fixed_rows_mut::<6>(RESIDUAL_FORCE)
            .copy_from(&residual.column(k));
        factors.add(
            residual.elements()[(k, k)],
            &mut direction,
            RESIDUAL_FORCE + k,
        );
    }
}

/// Forgets what was known of the motion, which then has these variances and is correlated with nothing.
pub fn renew_motion<T: Real>(factors: &mut Factors<T>, variances: &[T; MOTION_STATES]) {
    let elements = factors.elements_mut();
    for (k, variance) in variances.iter().enumerate() {
        elements.row_mut(k).fill(T::zero());
        elements[(k, k)] = *variance;
    }
}

/// Forgets what was known of the inputs, which then have their long-run covariance. Works in place, because two
/// covariances do not fit on a unit's stack.
pub fn renew_inputs<T: Real>(factors: &mut Factors<T>, process: &Process<T>) {
    let motion: [T; MOTION_STATES] = core::array::from_fn(|k| factors.variance(k));
    let (spread, residual) = (process.spread(), Ud::of(&process.residual_covariance()));
    let elements = factors.elements_mut();
    for k in MUSCLE..STATES {
        elements.column_mut(k).fill(T::zero());
    }
    for k in 0..6 {
        elements[(MUSCLE + k, MUSCLE + k)] = spread[k];
    }
    elements
        .fixed_view_mut::<6, 6>(RESIDUAL_FORCE, RESIDUAL_FORCE)
        .copy_from(residual.elements());
    renew_motion(factors, &motion);
    factors.keep_positive();
}

/// Limits the variances of the motion to those of an unknown motion. Returns whether any was larger.
pub fn limit<T: Real>(factors: &mut Factors<T>) -> bool {
    let mut variances = [T::zero(); MOTION_STATES];
    let mut beyond = false;
    for (k, variance) in variances.iter_mut().enumerate() {
        let largest = unknown(k);
        *variance = factors.variance(k);
        // The comparison is false for NaN.
        let known = *variance <= largest;
        if !known {
            *variance = largest;
            beyond = true;
        }
    }
    if beyond {
        renew_motion(factors, &variances);
    }
    beyond
}

/// Variance of an error coordinate of the motion or the residual load of which nothing is known.
pub fn unknown<T: Real>(k: usize) -> T {
    let [attitude, velocity, spin] = UNKNOWN;
    let [force, moment] = UNKNOWN_LOAD;
    let deviation = match k {
        ATTITUDE..VELOCITY => attitude,
        VELOCITY..SPIN => velocity,
        RESIDUAL_FORCE..RESIDUAL_MOMENT => force,
        RESIDUAL_MOMENT.. => moment,
        _ => spin,
    };
    T::single(deviation * deviation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimator::motion::settings::MOTION;
    use crate::estimator::motion::transition::spread;
    use nalgebra::SMatrix;

    #[test]
    fn the_factors_cross_an_interval_as_the_covariance_does() {
        let mut process = Process::<f64>::new(&MOTION, 1.0 / 120.0).unwrap();
        process.set_sensitivity(&SMatrix::from_fn(|i, j| if i == j { 0.3 } else { 0.1 }));
        process.set_activity([0.0, 0.4, 1.0]);
        let mix = |k: usize| libm::sin(1.0 + k as f64);
        let slope =
            MotionSlope::from_fn(|i, j| 0.1 * mix(3 * i + j) + if i == j { 1.0 } else { 0.0 });
        let mut covariance = SMatrix::<f64, STATES, STATES>::from_fn(|i, j| {
            mix(i) * mix(j) + if i == j { 1.0 } else { 0.0 }
        });
        let mut factors = Ud::of(&covariance);
        for _ in 0..3 {
            spread(&mut covariance, &slope, &process);
            cross(&mut factors, &slope, &process);
        }
        let gap = (factors.product() - covariance).abs().max();
        assert!(gap < 1e-9 * covariance.abs().max(), "{gap}");
    }

    #[test]
    fn an_unknown_motion_has_a_largest_uncertainty() {
        let mut factors = Factors::<f32>::diagonal(&SVector::repeat(1.0));
        assert!(!limit(&mut factors));
        factors.add_to(VELOCITY, 1e8);
        factors.add_to(ATTITUDE, f32::NAN);
        assert!(limit(&mut factors));
        assert!(factors.is_finite());
        assert!((factors.variance(VELOCITY) - 2500.0).abs() < 1.0);
        assert!((factors.variance(MUSCLE) - 1.0).abs() < 1e-6);
    }
}
