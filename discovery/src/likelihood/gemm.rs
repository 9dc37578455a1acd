//! Products of large matrices, computed in blocks that fit into the cache.
//!
//! The matrix library's own products are plain loops. Its feature that makes them fast would also change the
//! last bits of the core's results, because features are shared.

use nalgebra::DMatrix;
use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayView2, ArrayViewMut2, ShapeBuilder};

fn view(matrix: &DMatrix<f64>) -> ArrayView2<'_, f64> {
    let shape = (matrix.nrows(), matrix.ncols()).f();
    ArrayView2::from_shape(shape, matrix.as_slice()).unwrap_or_else(|_| ArrayView2::from(&[[]; 0]))
}

fn multiplied(a: &ArrayView2<'_, f64>, b: &ArrayView2<'_, f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.nrows(), b.ncols());
    let shape = (a.nrows(), b.ncols()).f();
    if let Ok(mut product) = ArrayViewMut2::from_shape(shape, product.as_mut_slice()) {
        general_mat_mul(1.0, a, b, 0.0, &mut product);
    }
    product
}

/// `a b`.
pub(crate) fn product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiplied(&view(a), &view(b))
}

/// `a^T b`.
pub(crate) fn transposed_product(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiplied(&view(a).t(), &view(b))
}

/// `a b^T`.
pub(crate) fn product_transposed(a: &DMatrix<f64>, b: &DMatrix<f64>) -> DMatrix<f64> {
    multiplied(&view(a), &view(b).t())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_are_those_of_plain_loops() {
        let matrix = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |j, k| ((3 * j + 7 * k) % 11) as f64 - 5.0)
        };
        let (a, b, c) = (matrix(9, 13), matrix(13, 5), matrix(9, 5));
        assert_eq!(product(&a, &b), &a * &b);
        assert_eq!(transposed_product(&a, &c), a.tr_mul(&c));
        assert_eq!(product_transposed(&b, &c), &b * c.transpose());
    }
}
