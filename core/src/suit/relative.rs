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

/// Number of pairs of sensors, those of a sensor with itself included: the second size of [`Relative`].
pub const fn pairs_of(sensors: usize) -> usize {
    sensors * (sensors + 1) / 2
}

/// Joint covariance of the errors of up to `N` sensors (rad2); `P` is their number of pairs, [`pairs_of`].
///
/// The error of a mounting has two parts. That across the vertical of the first pose says nothing about any attitude, and never
/// changes. That about it is the error of the heading, one number, and shared with the attitude. What comparisons make two
/// mountings share is left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative<T: Real, const N: usize, const P: usize> {
    /// Attitudes with each other, reference axes: the upper triangle, column by column.
    attitude: [Matrix3<T>; P],
    /// Headings (first index) with attitudes.
    heading: [[Vector3<T>; N]; N],
    /// Each mounting.
    mounting: [Mounted<T>; N],
}

/// Error of a mounting that was found in a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mounted<T: Real> {
    /// The vertical in the pose, segment axes.
    pub vertical: Vector3<T>,
    /// Variance about each axis across it (rad2).
    pub tilt: T,
    /// Variance about it (rad2).
    pub heading: T,
}

impl<T: Real> Mounted<T> {
    /// The vertical and the covariance in the axes to which a rotation leads.
    fn seen(&self, of_segment: &Matrix3<T>) -> (Vector3<T>, Matrix3<T>) {
        let vertical = of_segment * self.vertical;
        let about = vertical * vertical.transpose() * (self.heading - self.tilt);
        (vertical, Matrix3::from_diagonal_element(self.tilt) + about)
    }
}

/// Place of a block of the upper triangle.
const fn place(row: usize, column: usize) -> usize {
    pairs_of(column) + row
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

impl<T: Real, const N: usize, const P: usize> Relative<T, N, P> {
    /// Sensors without errors.
    pub fn new() -> Self {
        const { assert!(P == pairs_of(N), "one block for each pair") };
        let exact = Mounted {
            vertical: Vector3::z(),
            tilt: T::zero(),
            heading: T::zero(),
        };
        Self {
            attitude: [Matrix3::zeros(); P],
            heading: [[Vector3::zeros(); N]; N],
            mounting: [exact; N],
        }
    }

    /// Sets the covariance of a sensor's attitude and that of its mounting, which share the heading.
    pub fn set(&mut self, sensor: usize, attitude: Matrix3<T>, mounting: Mounted<T>) {
        if sensor >= N {
            return;
        }
        self.attitude[place(sensor, sensor)] = attitude;
        self.mounting[sensor] = mounting;
        self.heading[sensor][sensor] = Vector3::z() * mounting.heading;
    }

    /// Covariance of the attitudes of two sensors.
    fn with(&self, one: usize, other: usize) -> Matrix3<T> {
        if one <= other {
            self.attitude[place(one, other)]
        } else {
            self.attitude[place(other, one)].transpose()
        }
    }

    /// Adds variances to a sensor's attitude error (rad2, reference axes).
    pub fn grow(&mut self, sensor: usize, variances: &Vector3<T>) {
        if sensor < N && variances.iter().all(|v| v.is_finite() && *v >= T::zero()) {
            for axis in 0..3 {
                self.attitude[place(sensor, sensor)][(axis, axis)] += variances[axis];
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
        let with_attitude: [Matrix3<T>; N] = core::array::from_fn(|i| {
            let relative = match other {
                Some(other) => self.with(i, one) - self.with(i, other),
                None => self.with(i, one),
            };
            relative * slope.transpose()
        });
        let with_heading: [Vector3<T>; N] = core::array::from_fn(|i| {
            let row = &self.heading[i];
            slope * other.map_or(row[one], |other| row[one] - row[other])
        });
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
            let turned = with_heading[i].dot(&(inverse * gap));
            [
                with_attitude[i] * (inverse * gap),
                self.mounting[i].vertical * turned,
            ]
        });
        self.learn(&with_attitude, &with_heading, &inverse);
        (Some(errors), mismatch / T::of(3.0))
    }

    /// Takes off what a comparison has shown: the covariances with the difference, and the inverse of the difference's own.
    fn learn(
        &mut self,
        with_attitude: &[Matrix3<T>; N],
        with_heading: &[Vector3<T>; N],
        inverse: &Matrix3<T>,
    ) {
        for i in 0..N {
            let (gain, of_heading) = (with_attitude[i] * inverse, inverse * with_heading[i]);
            for (j, with) in with_attitude.iter().enumerate() {
                if j >= i {
                    self.attitude[place(i, j)] -= gain * with.transpose();
                }
                self.heading[i][j] -= with * of_heading;
            }
            let own = &mut self.attitude[place(i, i)];
            *own = own.transpose();
            let heading = &mut self.mounting[i].heading;
            *heading -= of_heading.dot(&with_heading[i]);
            let variances = [(0, 0), (1, 1), (2, 2)];
            for axis in variances {
                if own[axis] < T::zero() {
                    own[axis] = T::zero();
                }
            }
            if *heading < T::zero() {
                *heading = T::zero();
            }
        }
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
        let attitude = self.with(one, one) + self.with(other, other)
            - self.with(one, other)
            - self.with(other, one);
        let (vertical, of_mounting) = self.mounting[one].seen(of_one);
        let (other_vertical, of_other_mounting) = self.mounting[other].seen(of_other);
        let mountings = of_mounting + of_other_mounting;
        // The error of a segment is that of the attitude less that of the mounting.
        let of =
            |k: usize, against: usize| (self.heading[k][k] - self.heading[k][against]).transpose();
        let cross = vertical * of(one, other) + other_vertical * of(other, one);
        attitude + mountings - cross - cross.transpose()
    }
}

impl<T: Real, const N: usize, const P: usize> Default for Relative<T, N, P> {
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
    fn headed() -> Relative<f32, 2, 3> {
        let mut relative = Relative::new();
        let heading = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, 0.04));
        let mounting = Mounted {
            vertical: Vector3::z(),
            tilt: 1e-3,
            heading: 0.04,
        };
        relative.set(1, heading, mounting);
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

    type Dense = nalgebra::SMatrix<f64, 18, 18>;

    /// The rotation matrix of a turn.
    fn turned(x: f64, y: f64, z: f64) -> Matrix3<f64> {
        let turn = rotation_by(&Vector3::new(x, y, z));
        turn.to_rotation_matrix().into_inner()
    }

    /// Three sensors are compared again and again, while all errors grow. The truth is the filter over all attitudes and all
    /// mountings, three numbers each, with their whole covariance but for that of mountings with each other.
    #[test]
    fn nothing_is_lost_by_the_short_form_of_the_covariance() {
        let mut relative = Relative::<f64, 3, 6>::new();
        let mut dense = Dense::zeros();
        for k in 0..3 {
            let share = 1.0 + f64::from(u8::try_from(k).unwrap());
            let (tilt, heading) = (0.003 * share, 0.02 * share);
            let of_segment = turned(0.3 * share, -0.4, 0.2 * share);
            let attitude = Matrix3::from_diagonal(&Vector3::new(1e-4, 1e-4, heading + tilt));
            let mounted = Mounted {
                vertical: of_segment.transpose() * Vector3::z(),
                tilt,
                heading,
            };
            relative.set(k, attitude, mounted);
            let shared = Matrix3::from_diagonal(&Vector3::new(0.0, 0.0, heading));
            let found = Matrix3::from_diagonal(&Vector3::new(tilt, tilt, heading));
            let cross = of_segment.transpose() * shared;
            let (a, m) = (3 * k, 9 + 3 * k);
            dense.fixed_view_mut::<3, 3>(a, a).copy_from(&attitude);
            let mounting = of_segment.transpose() * found * of_segment;
            dense.fixed_view_mut::<3, 3>(m, m).copy_from(&mounting);
            dense.fixed_view_mut::<3, 3>(m, a).copy_from(&cross);
            dense
                .fixed_view_mut::<3, 3>(a, m)
                .copy_from(&cross.transpose());
        }
        let pairs = [(1, Some(0)), (2, Some(1)), (0, None), (2, Some(0))];
        for step in 0..24_u8 {
            let time = f64::from(step);
            let (one, other) = pairs[usize::from(step) % 4];
            let vector = turned(0.2 * time, 0.5 * time, 0.1 * time) * Vector3::new(3.0, 1.0, 9.0);
            let off = Vector3::new(0.1, -0.2, 0.15) * (1.0 + 0.1 * time);
            let comparison = Comparison {
                pair: (one, other),
                seen: vector + off,
                expected: vector,
                variance: 0.5,
            };
            for sensor in 0..3 {
                relative.grow(sensor, &Vector3::new(1e-5, 2e-5, 3e-5));
                for (axis, growth) in [1e-5, 2e-5, 3e-5].into_iter().enumerate() {
                    dense[(3 * sensor + axis, 3 * sensor + axis)] += growth;
                }
            }
            let (errors, _) = relative.compare(&comparison);
            let across = if other.is_some() {
                vector + off * 0.5
            } else {
                vector
            };
            let mut slope = nalgebra::SMatrix::<f64, 3, 18>::zeros();
            slope
                .fixed_view_mut::<3, 3>(0, 3 * one)
                .copy_from(&-skew(&across));
            if let Some(other) = other {
                slope
                    .fixed_view_mut::<3, 3>(0, 3 * other)
                    .copy_from(&skew(&across));
            }
            let spread = slope * dense * slope.transpose() + Matrix3::from_diagonal_element(0.5);
            let gain = dense * slope.transpose() * spread.try_inverse().unwrap();
            let expected = gain * off;
            dense -= gain * slope * dense;
            for (k, [attitude, mounting]) in errors.unwrap().iter().enumerate() {
                for axis in 0..3 {
                    assert!((attitude[axis] - expected[3 * k + axis]).abs() < 1e-12);
                    assert!((mounting[axis] - expected[9 + 3 * k + axis]).abs() < 1e-12);
                }
            }
            let segments = [turned(0.1 * time, 0.3, 0.0), turned(0.0, 0.2 * time, 1.0)];
            for (one, other) in [(0, 1), (1, 2), (2, 0)] {
                let mut error = nalgebra::SMatrix::<f64, 3, 18>::zeros();
                for (k, sign, of) in [(one, 1.0, segments[0]), (other, -1.0, segments[1])] {
                    let unit = Matrix3::from_diagonal_element(sign);
                    error.fixed_view_mut::<3, 3>(0, 3 * k).copy_from(&unit);
                    error
                        .fixed_view_mut::<3, 3>(0, 9 + 3 * k)
                        .copy_from(&(of * -sign));
                }
                let mut kept = dense;
                for (row, column) in [(one, other), (other, one)] {
                    let mut block = kept.fixed_view_mut::<3, 3>(9 + 3 * row, 9 + 3 * column);
                    block.fill(0.0);
                }
                let expected = error * kept * error.transpose();
                let found = relative.between((one, &segments[0]), (other, &segments[1]));
                assert!((found - expected).norm() < 1e-12, "{found} {expected}");
            }
        }
    }
}
