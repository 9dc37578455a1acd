//! Attitude errors of all sensors relative to each other, with their joint covariance.
//!
//! Two sensors that see the same vector, the force at their common joint or the turn of the whole body, show their
//! relative attitude except about that vector. The errors of all sensors are one state, since a sensor has several
//! neighbours. The error of each mounting is correlated with them: who corrects a heading corrects the mounting that was
//! found with it.

use nalgebra::{Matrix3, Vector3};

use crate::math::{Real, inverse_symmetric, skew};

/// Normalised square of a mismatch (three axes) beyond which it is not used.
const GATE: f64 = 25.0;
/// Least of a vector's variance, each axis, as a share of its square: keeps the algebra conditioned in single precision.
const LEAST_VARIANCE: f64 = 1e-5;

/// Joint covariance of the errors of up to `N` sensors (rad2).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative<T: Real, const N: usize> {
    /// Attitudes with each other, reference axes.
    attitude: [[Matrix3<T>; N]; N],
    /// Mountings (first index, segment axes) with attitudes.
    cross: [[Matrix3<T>; N]; N],
    /// Each mounting.
    mounting: [Matrix3<T>; N],
}

/// Estimated errors of the sensors after a comparison (rad): of the attitude and of the mounting.
pub type Errors<T, const N: usize> = [[Vector3<T>; 2]; N];

/// A vector as two sensors see it, in reference axes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Comparison<T: Real> {
    /// The sensor, and the one it is compared with; `None` for the truth.
    pub pair: (usize, Option<usize>),
    /// What the sensor sees.
    pub seen: Vector3<T>,
    /// What the other one sees.
    pub expected: Vector3<T>,
    /// Variance of each component of the difference.
    pub variance: T,
}

impl<T: Real, const N: usize> Relative<T, N> {
    /// Sensors without errors.
    pub fn new() -> Self {
        Self {
            attitude: [[Matrix3::zeros(); N]; N],
            cross: [[Matrix3::zeros(); N]; N],
            mounting: [Matrix3::zeros(); N],
        }
    }

    /// Sets the covariances of a sensor's errors: of attitude, of mounting, and of mounting with attitude.
    pub fn set(
        &mut self,
        sensor: usize,
        attitude: Matrix3<T>,
        mounting: Matrix3<T>,
        cross: Matrix3<T>,
    ) {
        if sensor >= N {
            return;
        }
        self.attitude[sensor][sensor] = attitude;
        self.mounting[sensor] = mounting;
        self.cross[sensor][sensor] = cross;
    }

    /// Adds variances to a sensor's attitude error (rad2, reference axes).
    pub fn grow(&mut self, sensor: usize, variances: &Vector3<T>) {
        if sensor < N && variances.iter().all(|v| v.is_finite() && *v >= T::zero()) {
            for axis in 0..3 {
                self.attitude[sensor][sensor][(axis, axis)] += variances[axis];
            }
        }
    }

    /// Compares two sensors. Returns the errors, and the mismatch: the mean square of the three differences in standard
    /// deviations. Nothing is changed and no error returned if the mismatch is too large, or a number not finite.
    pub fn compare(&mut self, comparison: &Comparison<T>) -> (Option<Errors<T, N>>, T) {
        let Comparison {
            pair: (one, other),
            seen,
            expected,
            variance,
        } = *comparison;
        if one >= N || other.is_some_and(|other| other >= N || other == one) {
            return (None, T::zero());
        }
        let across = match other {
            Some(_) => (seen + expected) * T::of(0.5),
            None => expected,
        };
        // seen = expected + error x expected
        let slope = -skew(&across);
        let gap = seen - expected;
        let relative = |row: &[Matrix3<T>; N]| match other {
            Some(other) => row[one] - row[other],
            None => row[one],
        };
        let with_attitude: [Matrix3<T>; N] =
            core::array::from_fn(|i| relative(&self.attitude[i]) * slope.transpose());
        let with_mounting: [Matrix3<T>; N] =
            core::array::from_fn(|i| relative(&self.cross[i]) * slope.transpose());
        let own = match other {
            Some(other) => with_attitude[one] - with_attitude[other],
            None => with_attitude[one],
        };
        let least = across.norm_squared() * T::of(LEAST_VARIANCE);
        let variance = if variance > least { variance } else { least };
        let spread = slope * own;
        let spread =
            (spread + spread.transpose()) * T::of(0.5) + Matrix3::from_diagonal_element(variance);
        let Some(inverse) = inverse_symmetric(&spread) else {
            return (None, T::zero());
        };
        let mismatch = gap.dot(&(inverse * gap));
        let is_within = mismatch <= T::of(GATE);
        if !is_within {
            return (None, finite(mismatch / T::of(3.0)));
        }
        let errors = core::array::from_fn(|i| {
            [with_attitude[i], with_mounting[i]].map(|with| with * (inverse * gap))
        });
        for i in 0..N {
            let (gain, of_mounting) = (with_attitude[i] * inverse, with_mounting[i] * inverse);
            for (j, with) in with_attitude.iter().enumerate() {
                let with = with.transpose();
                if j >= i {
                    self.attitude[i][j] -= gain * with;
                    self.attitude[j][i] = self.attitude[i][j].transpose();
                }
                self.cross[i][j] -= of_mounting * with;
            }
            self.mounting[i] -= of_mounting * with_mounting[i].transpose();
            for axis in 0..3 {
                for block in [&mut self.attitude[i][i], &mut self.mounting[i]] {
                    if block[(axis, axis)] < T::zero() {
                        block[(axis, axis)] = T::zero();
                    }
                }
            }
        }
        (Some(errors), mismatch / T::of(3.0))
    }

    /// Covariance of the orientation of one segment relative to another (rad2, reference axes); the rotations are from
    /// segment to reference axes.
    pub fn between(
        &self,
        (one, of_one): (usize, &Matrix3<T>),
        (other, of_other): (usize, &Matrix3<T>),
    ) -> Matrix3<T> {
        if one >= N || other >= N || one == other {
            return Matrix3::zeros();
        }
        let attitude = self.attitude[one][one] + self.attitude[other][other]
            - self.attitude[one][other]
            - self.attitude[other][one];
        let mountings = of_one * self.mounting[one] * of_one.transpose()
            + of_other * self.mounting[other] * of_other.transpose();
        // The error of a segment is that of the attitude less that of the mounting.
        let with_one = of_one * (self.cross[one][one] - self.cross[one][other]);
        let with_other = of_other * (self.cross[other][other] - self.cross[other][one]);
        let cross = with_one + with_other;
        attitude + mountings - cross - cross.transpose()
    }
}

impl<T: Real, const N: usize> Default for Relative<T, N> {
    fn default() -> Self {
        Self::new()
    }
}

fn finite<T: Real>(value: T) -> T {
    if value.is_finite() { value } else { T::zero() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::rotation_by;

    /// Two sensors, the second with a wrong heading and a mounting found with it.
    fn headed() -> Relative<f32, 2> {
        let mut relative = Relative::new();
        let heading = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, 0.04));
        let tilt = Matrix3::from_diagonal(&Vector3::new(1e-3, 1e-3, 0.04));
        relative.set(1, heading, tilt, heading);
        relative
    }

    #[test]
    fn a_heading_is_seen_across_the_vertical_and_takes_the_mounting_along() {
        let wrong = rotation_by(&Vector3::new(0.0, 0.0, 0.2_f32));
        let mut relative = headed();
        let upright = Matrix3::identity();
        let before = relative.between((1, &upright), (0, &upright));
        assert!(
            before[(2, 2)] < 1e-6,
            "in the first pose it does not matter"
        );
        let leaning = rotation_by(&Vector3::new(1.5_f32, 0.0, 0.0))
            .to_rotation_matrix()
            .into_inner();
        let then = relative.between((1, &leaning), (0, &upright));
        assert!(then[(2, 2)] > 0.03, "in another it does");
        let mut see = |vector: Vector3<f32>| {
            let comparison = Comparison {
                pair: (1, Some(0)),
                seen: wrong * vector,
                expected: vector,
                variance: 0.25,
            };
            relative.compare(&comparison)
        };
        let (vertical, _) = see(Vector3::new(0.0, 0.0, 9.8));
        assert!(vertical.unwrap()[1][0].norm() < 1e-3, "not about itself");
        let (level, mismatch) = see(Vector3::new(9.0, 3.0, 0.0));
        let [attitude, mounting] = level.unwrap()[1];
        assert!(mismatch < 2.0, "{mismatch}");
        assert!((attitude.z - 0.2).abs() < 0.02, "{attitude}");
        assert!((mounting.z - 0.2).abs() < 0.02, "{mounting}");
        let after = relative.between((1, &leaning), (0, &upright));
        assert!(after[(2, 2)] < 0.01, "{after}");
    }

    #[test]
    fn a_mismatch_changes_nothing_and_is_reported() {
        let mut relative = headed();
        let before = relative;
        for seen in [
            Vector3::new(0.0, -9.0, 0.0),
            Vector3::new(f32::NAN, 0.0, 0.0),
        ] {
            let (errors, _) = relative.compare(&Comparison {
                pair: (1, Some(0)),
                seen,
                expected: Vector3::new(0.0, 0.0, 9.8),
                variance: 0.25,
            });
            assert!(errors.is_none());
        }
        assert_eq!(relative, before);
    }
}
