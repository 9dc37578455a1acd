//! A covariance as `U D U^T`, with `U` unit upper triangular and `D` diagonal and positive.
//!
//! Such a product is positive definite whatever `U` and `D` are, so rounding in single precision cannot make it
//! indefinite: an update multiplies the elements of `D` by ratios between zero and one and adds to them, and never
//! subtracts. Elements that would leave the range in which products are accurate are clamped and counted. After Bierman
//! (1977), chapters 3 and 5.

use nalgebra::{SMatrix, SVector};

use crate::math::{Real, flushed};

/// Smallest and largest element of `D`.
pub const PIVOTS: [f64; 2] = [1e-12, 1_048_576.0];
/// Largest magnitude of an element of `U`.
pub const LARGEST_UNIT: f64 = 1e9;

/// A factored covariance: `D` on the diagonal, `U` above it; the rest is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ud<T: Real, const N: usize> {
    elements: SMatrix<T, N, N>,
}

/// How an error along one direction shows: its variance and its covariance with every coordinate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen<T: Real, const N: usize> {
    /// `U^T h`.
    along: SVector<T, N>,
    /// Variance of the direction, `h^T P h`.
    pub variance: T,
}

impl<T: Real, const N: usize> Ud<T, N> {
    /// Independent errors with these variances.
    pub fn diagonal(variances: &SVector<T, N>) -> Self {
        let mut made = Self {
            elements: SMatrix::from_diagonal(variances),
        };
        made.keep_positive();
        made
    }

    /// Factors a symmetric matrix. Pivots below the rounding error of their diagonal element are raised to it.
    pub fn of(matrix: &SMatrix<T, N, N>) -> Self {
        let mut left = *matrix;
        let mut elements = SMatrix::<T, N, N>::zeros();
        for j in (0..N).rev() {
            let least = matrix[(j, j)].abs() * T::default_epsilon() * T::of(16.0);
            // The comparison is false for NaN.
            let sound = left[(j, j)] > least && left[(j, j)] > T::of(PIVOTS[0]);
            let pivot = if sound {
                left[(j, j)]
            } else if least > T::of(PIVOTS[0]) {
                least
            } else {
                T::of(PIVOTS[0])
            };
            elements[(j, j)] = pivot;
            let inverse = T::one() / pivot;
            for i in 0..j {
                elements[(i, j)] = left[(i, j)] * inverse;
            }
            for k in 0..j {
                let factor = elements[(k, j)] * pivot;
                for i in 0..=k {
                    let product = elements[(i, j)] * factor;
                    left[(i, k)] -= product;
                }
            }
        }
        Self { elements }
    }

    /// Returns the product `U D U^T`.
    pub fn product(&self) -> SMatrix<T, N, N> {
        let mut product = SMatrix::<T, N, N>::zeros();
        for k in 0..N {
            let column = self.column(k);
            for j in 0..=k {
                let factor = column[j] * self.elements[(k, k)];
                for i in 0..=j {
                    product[(i, j)] += column[i] * factor;
                }
            }
        }
        product.fill_lower_triangle_with_upper_triangle();
        product
    }

    /// Column of `U`, with its one.
    pub fn column(&self, k: usize) -> SVector<T, N> {
        let mut column = self.elements.column(k).into_owned();
        column[k] = T::one();
        column
    }

    /// Elements: `D` on the diagonal, `U` above it.
    pub fn elements(&self) -> &SMatrix<T, N, N> {
        &self.elements
    }

    /// Elements, to be changed by a propagation; the rest below the diagonal must stay zero.
    pub(crate) fn elements_mut(&mut self) -> &mut SMatrix<T, N, N> {
        &mut self.elements
    }

    /// Returns the variance of a coordinate.
    #[inline]
    pub fn variance(&self, k: usize) -> T {
        let mut sum = self.elements[(k, k)];
        for j in k + 1..N {
            let unit = self.elements[(k, j)];
            sum += unit * unit * self.elements[(j, j)];
        }
        sum
    }

    /// Returns the covariance of `M` coordinates from `first` on.
    pub fn block<const M: usize>(&self, first: usize) -> SMatrix<T, M, M> {
        let unit = |row: usize, column: usize| {
            if row == column {
                T::one()
            } else {
                self.elements[(row, column)]
            }
        };
        SMatrix::from_fn(|i, j| {
            let (row, column) = (first + i.min(j), first + i.max(j));
            let mut sum = T::zero();
            for k in column..N {
                sum += unit(row, k) * self.elements[(k, k)] * unit(column, k);
            }
            sum
        })
    }

    /// Returns the variances of all coordinates.
    pub fn variances(&self) -> SVector<T, N> {
        SVector::from_fn(|k, _| self.variance(k))
    }

    /// Adds `variance * a a^T`; the elements of `a` beyond `last` are not used, and `a` is left changed.
    #[inline]
    pub fn add(&mut self, variance: T, a: &mut SVector<T, N>, last: usize) {
        let mut weight = variance;
        for j in (0..=last).rev() {
            let pivot = self.elements[(j, j)];
            let own = a[j];
            let larger = pivot + weight * own * own;
            let inverse = T::one() / larger;
            let share = weight * own * inverse;
            for i in 0..j {
                let unit = self.elements[(i, j)];
                let rest = a[i] - own * unit;
                a[i] = rest;
                self.elements[(i, j)] = unit + share * rest;
            }
            weight *= pivot * inverse;
            self.elements[(j, j)] = larger;
        }
    }

    /// Adds a variance to one coordinate, independent of all others.
    #[inline]
    pub fn add_to(&mut self, k: usize, variance: T) {
        let mut unit = SVector::<T, N>::zeros();
        unit[k] = T::one();
        self.add(variance, &mut unit, k);
    }

    /// Looks along the direction whose first elements are `slope`; the others are zero.
    #[inline]
    pub fn see(&self, slope: &[T]) -> Seen<T, N> {
        let mut along = SVector::<T, N>::zeros();
        let mut variance = T::zero();
        for j in 0..N {
            let mut sum = slope.get(j).copied().unwrap_or_else(T::zero);
            for (i, slope) in slope.iter().enumerate().take(j) {
                sum += self.elements[(i, j)] * *slope;
            }
            along[j] = sum;
            variance += sum * sum * self.elements[(j, j)];
        }
        Seen { along, variance }
    }

    /// Updates with a measurement along the direction `seen`, of variance `noise`, and returns the covariance of each
    /// coordinate with that direction before the update (Bierman's algorithm).
    #[inline]
    pub fn update(&mut self, seen: &Seen<T, N>, noise: T) -> SVector<T, N> {
        let mut spread = SVector::<T, N>::zeros();
        let mut before = noise;
        for j in 0..N {
            let along = seen.along[j];
            let pivot = self.elements[(j, j)];
            let weighted = pivot * along;
            let after = before + along * weighted;
            let factor = -along / before;
            self.elements[(j, j)] = pivot * (before / after);
            for i in 0..j {
                let unit = self.elements[(i, j)];
                self.elements[(i, j)] = unit + factor * spread[i];
                spread[i] += weighted * unit;
            }
            spread[j] = weighted;
            before = after;
        }
        spread
    }

    /// Clamps `D` and `U` to their ranges; returns whether anything was outside, which includes what is not finite.
    pub fn keep_positive(&mut self) -> bool {
        let [low, high] = PIVOTS.map(T::of);
        let largest = T::of(LARGEST_UNIT);
        let mut changed = false;
        for j in 0..N {
            let pivot = self.elements[(j, j)];
            // Comparisons are false for NaN.
            let large_enough = pivot >= low;
            let small_enough = pivot <= high;
            if !(large_enough && small_enough) {
                self.elements[(j, j)] = if large_enough { high } else { low };
                changed = true;
            }
            for i in 0..j {
                let sound = self.elements[(i, j)].abs() <= largest;
                self.elements[(i, j)] = if sound {
                    flushed(self.elements[(i, j)])
                } else {
                    T::zero()
                };
                changed |= !sound;
            }
        }
        changed
    }

    /// Returns whether every element is finite.
    pub fn is_finite(&self) -> bool {
        self.elements.iter().all(|v| v.is_finite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;
    use proptest::prelude::*;

    type Six = SMatrix<f64, 6, 6>;

    fn any_covariance() -> impl Strategy<Value = Six> {
        prop::collection::vec(-1.0f64..1.0, 36).prop_map(|values| {
            let mix = Six::from_column_slice(&values) + Six::identity() * 1.5;
            mix * mix.transpose()
        })
    }

    fn any_direction() -> impl Strategy<Value = SVector<f64, 6>> {
        prop::array::uniform6(-2.0f64..2.0).prop_map(SVector::from)
    }

    proptest! {
        #[test]
        fn the_product_of_the_factors_is_the_matrix(matrix in any_covariance()) {
            let factored = Ud::of(&matrix);
            prop_assert!((factored.product() - matrix).abs().max() < 1e-11);
            prop_assert!((factored.variances() - matrix.diagonal()).abs().max() < 1e-11);
        }

        #[test]
        fn an_addition_adds(matrix in any_covariance(), direction in any_direction(), last in 0usize..6) {
            let mut direction = direction;
            for k in last + 1..6 {
                direction[k] = 0.0;
            }
            let mut factored = Ud::of(&matrix);
            factored.add(0.7, &mut direction.clone(), last);
            let expected = matrix + direction * direction.transpose() * 0.7;
            prop_assert!((factored.product() - expected).abs().max() < 1e-11);
        }

        #[test]
        fn an_update_is_that_of_kalman(matrix in any_covariance(), direction in any_direction(), noise in 0.01f64..10.0) {
            let mut factored = Ud::of(&matrix);
            let short = &direction.as_slice()[..4];
            let mut whole = direction;
            whole[4] = 0.0;
            whole[5] = 0.0;
            let seen = factored.see(short);
            let spread = matrix * whole;
            prop_assert!((seen.variance - whole.dot(&spread)).abs() < 1e-10);
            let found = factored.update(&seen, noise);
            prop_assert!((found - spread).abs().max() < 1e-10);
            let expected = matrix - spread * spread.transpose() / (seen.variance + noise);
            prop_assert!((factored.product() - expected).abs().max() < 1e-9);
        }

        #[test]
        fn single_precision_stays_definite(
            steps in prop::collection::vec((prop::array::uniform6(-100.0f32..100.0), -12i32..9, -8i32..6), 60),
        ) {
            // Updates and additions over twenty decades, far worse conditioned than single precision can represent.
            let mut factored = Ud::<f32, 6>::diagonal(&SVector::repeat(1.0));
            for (direction, noise, added) in steps {
                let ten = |power: i32| f32::of(libm::pow(10.0, f64::from(power)));
                let seen = factored.see(&direction);
                factored.update(&seen, ten(noise));
                factored.add(ten(added), &mut SVector::from(direction), 5);
                factored.keep_positive();
                prop_assert!(factored.is_finite());
                prop_assert!((0..6).all(|k| factored.elements()[(k, k)] > 0.0));
            }
        }
    }
}
