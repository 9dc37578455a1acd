//! Factors of small symmetric matrices at a fixed cost, without pivoting, convergence tests or failure.
//!
//! If rounding has left a covariance slightly indefinite, the result is the factor of a nearby positive definite
//! matrix (relative to its own scale) and a count of the corrections made.

use nalgebra::SMatrix;

use crate::math::Real;

/// Number of Jacobi sweeps that reach rounding accuracy for six rows, found by test. Convergence is quadratic, so
/// twice the digits take one more sweep.
fn sweeps<T: Real>() -> usize {
    if T::default_epsilon() > T::of(1e-10) {
        5
    } else {
        6
    }
}

/// Threshold below which a value is lost to rounding: for a Cholesky pivot as a share of its diagonal element, for an
/// eigenvalue as a share of the largest.
fn rounding_share<T: Real>() -> T {
    T::default_epsilon() * T::of(16.0)
}

/// Lower triangular `L` with `L L^T = matrix`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cholesky<T: Real, const N: usize> {
    lower: SMatrix<T, N, N>,
    /// Reciprocals of the diagonal; a division costs as much as fourteen multiplications on the unit.
    inverse_diagonal: [T; N],
    repaired: usize,
}

impl<T: Real, const N: usize> Cholesky<T, N> {
    /// Factors a symmetric matrix given by its lower triangle. Pivots too small to be told apart from rounding errors
    /// are raised to a threshold.
    #[inline]
    pub fn new(matrix: &SMatrix<T, N, N>) -> Self {
        let mut lower = SMatrix::<T, N, N>::zeros();
        let mut inverse_diagonal = [T::zero(); N];
        let mut repaired = 0;
        for j in 0..N {
            let mut pivot = matrix[(j, j)];
            let floor = rounding_share::<T>() * pivot.abs() + T::of(f64::from(f32::MIN_POSITIVE));
            for k in 0..j {
                pivot -= lower[(j, k)] * lower[(j, k)];
            }
            // The comparison is false for NaN.
            let sound = pivot > floor;
            if !sound {
                pivot = floor;
                repaired += 1;
            }
            let diagonal = pivot.root();
            // Root and reciprocal are independent, so that they can be computed in parallel.
            let inverse = diagonal * (T::one() / pivot);
            lower[(j, j)] = diagonal;
            inverse_diagonal[j] = inverse;
            for i in j + 1..N {
                let mut sum = matrix[(i, j)];
                for k in 0..j {
                    sum -= lower[(i, k)] * lower[(j, k)];
                }
                lower[(i, j)] = sum * inverse;
            }
        }
        Self {
            lower,
            inverse_diagonal,
            repaired,
        }
    }

    /// Returns the factor.
    #[inline]
    pub fn lower(&self) -> &SMatrix<T, N, N> {
        &self.lower
    }

    /// Returns the number of pivots that had to be raised.
    pub fn repaired(&self) -> usize {
        self.repaired
    }

    /// Computes `rhs L^-1`: for changes `S L` along the columns of `L` this is the slope `S`.
    pub fn solve<const R: usize>(&self, rhs: &SMatrix<T, R, N>) -> SMatrix<T, R, N> {
        let mut solution = *rhs;
        for j in (0..N).rev() {
            for k in j + 1..N {
                let factor = self.lower[(k, j)];
                for i in 0..R {
                    let known = solution[(i, k)];
                    solution[(i, j)] -= factor * known;
                }
            }
            for i in 0..R {
                solution[(i, j)] *= self.inverse_diagonal[j];
            }
        }
        solution
    }

    /// Computes `rhs L^-T`: for a cross covariance C_xz and `C_z = L L^T` this is the factor U with
    /// `K C_z K^T = U U^T`.
    #[inline]
    pub fn solve_transposed<const R: usize>(&self, rhs: &SMatrix<T, R, N>) -> SMatrix<T, R, N> {
        let mut solution = *rhs;
        for j in 0..N {
            for k in 0..j {
                let factor = self.lower[(j, k)];
                for i in 0..R {
                    let known = solution[(i, k)];
                    solution[(i, j)] -= factor * known;
                }
            }
            for i in 0..R {
                solution[(i, j)] *= self.inverse_diagonal[j];
            }
        }
        solution
    }
}

/// Returns the symmetric `S` with `S S = matrix`, by the cyclic Jacobi method. Negative eigenvalues are taken as zero.
pub fn symmetric_root<T: Real, const N: usize>(matrix: &SMatrix<T, N, N>) -> SMatrix<T, N, N> {
    let mut diagonalised = *matrix;
    let mut vectors = SMatrix::<T, N, N>::identity();
    for _ in 0..sweeps::<T>() {
        for p in 0..N {
            for q in p + 1..N {
                rotate(&mut diagonalised, &mut vectors, p, q);
            }
        }
    }
    let mut largest = T::zero();
    for k in 0..N {
        let value = diagonalised[(k, k)];
        largest = if value > largest { value } else { largest };
    }
    let floor = largest * rounding_share::<T>() * rounding_share::<T>();
    let mut root = SMatrix::<T, N, N>::zeros();
    for k in 0..N {
        let value = diagonalised[(k, k)];
        let scale = if value > floor { value } else { floor }.root();
        for j in 0..N {
            let factor = vectors[(j, k)] * scale;
            for i in 0..=j {
                root[(i, j)] += vectors[(i, k)] * factor;
            }
        }
    }
    for j in 0..N {
        for i in j + 1..N {
            root[(i, j)] = root[(j, i)];
        }
    }
    root
}

/// One Jacobi rotation that clears element (p, q).
#[inline]
fn rotate<T: Real, const N: usize>(
    a: &mut SMatrix<T, N, N>,
    vectors: &mut SMatrix<T, N, N>,
    p: usize,
    q: usize,
) {
    let (app, aqq, apq) = (a[(p, p)], a[(q, q)], a[(p, q)]);
    let (zero, one) = (T::zero(), T::one());
    // tan of the angle: the smaller root of t^2 + 2 d t - 1, with d = (aqq - app) / (2 apq).
    let difference = (aqq - app) * T::of(0.5);
    let length = (difference * difference + apq * apq).root();
    let denominator = difference.abs() + length;
    let tangent = if denominator > zero {
        apq / denominator
    } else {
        zero
    };
    let tangent = if difference < zero { -tangent } else { tangent };
    let cosine = one / (one + tangent * tangent).root();
    let sine = tangent * cosine;
    for k in 0..N {
        let (akp, akq) = (a[(k, p)], a[(k, q)]);
        let (new_p, new_q) = (cosine * akp - sine * akq, sine * akp + cosine * akq);
        if k != p && k != q {
            a[(k, p)] = new_p;
            a[(p, k)] = new_p;
            a[(k, q)] = new_q;
            a[(q, k)] = new_q;
        }
        let (vkp, vkq) = (vectors[(k, p)], vectors[(k, q)]);
        vectors[(k, p)] = cosine * vkp - sine * vkq;
        vectors[(k, q)] = sine * vkp + cosine * vkq;
    }
    a[(p, p)] = app - tangent * apq;
    a[(q, q)] = aqq + tangent * apq;
    a[(p, q)] = zero;
    a[(q, p)] = zero;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Lanes;
    use nalgebra::{SMatrix, SVector};
    use proptest::prelude::*;

    type Six = SMatrix<f64, 6, 6>;

    /// A positive definite matrix with a spread of scales like that of the paper's covariance.
    fn any_covariance() -> impl Strategy<Value = Six> {
        (
            prop::array::uniform32(-1.0f64..1.0),
            prop::array::uniform6(-3.0f64..1.0),
        )
            .prop_map(|(mix, scale)| {
                let mix = Six::from_fn(|i, j| if i == j { 1.5 } else { mix[(i * 6 + j) % 32] });
                let scale = SVector::from(scale.map(|s| libm::pow(10.0, s)));
                let factor = Six::from_diagonal(&scale) * mix;
                factor * factor.transpose()
            })
    }

    proptest! {
        #[test]
        fn roots_multiply_to_the_matrix(matrix in any_covariance()) {
            let scale = matrix.abs().max();
            let root = symmetric_root(&matrix);
            prop_assert!((root * root - matrix).abs().max() < 1e-12 * scale);
            prop_assert!((root - root.transpose()).abs().max() <= 0.0);
            let factor = Cholesky::new(&matrix);
            let lower = factor.lower();
            prop_assert!((lower * lower.transpose() - matrix).abs().max() < 1e-12 * scale);
            prop_assert_eq!(factor.repaired(), 0);
        }

        #[test]
        fn single_precision_roots_multiply_to_the_matrix(matrix in any_covariance()) {
            let matrix = matrix.map(f32::of);
            let root = symmetric_root(&matrix);
            prop_assert!((root * root - matrix).abs().max() < 3e-6 * matrix.abs().max());
        }

        #[test]
        fn triangular_solution_is_one(matrix in any_covariance(), rhs in prop::array::uniform12(-1.0f64..1.0)) {
            let rhs = SMatrix::<f64, 2, 6>::from_row_slice(&rhs);
            let factor = Cholesky::new(&matrix);
            let back = factor.solve_transposed(&rhs) * factor.lower().transpose();
            prop_assert!((back - rhs).abs().max() < 1e-7);
        }

        #[test]
        fn no_matrix_breaks_a_factor(bits in prop::array::uniform16(any::<u32>())) {
            // GIVEN any bits, THEN no panic; and for finite ones a finite factor with a positive diagonal.
            let matrix = SMatrix::<f32, 4, 4>::from_row_slice(&bits.map(f32::from_bits));
            let _ = symmetric_root(&matrix);
            let small = matrix.map(|v| if v.is_finite() { v % 1e6 } else { 1.0 });
            let factor = Cholesky::new(&(small + small.transpose()));
            prop_assert!((0..4).all(|k| factor.lower()[(k, k)] > 0.0));
        }
    }

    #[test]
    fn an_indefinite_matrix_is_repaired_and_counted() {
        let matrix = SMatrix::<f32, 2, 2>::new(1.0, 2.0, 2.0, 1.0);
        let factor = Cholesky::new(&matrix);
        assert_eq!(factor.repaired(), 1);
        assert!(factor.lower().iter().all(|v| v.is_finite()));
        assert!(symmetric_root(&matrix).iter().all(|v| v.is_finite()));
    }
}
