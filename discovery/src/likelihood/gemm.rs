//! Products of large matrices, computed in blocks that fit into the cache.
//!
//! The matrix library's own products are plain loops. Its feature that makes them fast would also change the
//! last bits of the core's results, because features are shared.

use core::ops::Range;

use nalgebra::DMatrix;
use ndarray::linalg::general_mat_mul;
use ndarray::{ArrayBase, ArrayView2, ArrayViewMut2, Axis, Ix2, RawData, ShapeBuilder};

/// Rows or columns of a block of a matrix of which one triangle is enough, or is zero.
const BLOCK: usize = 32;

fn view(matrix: &DMatrix<f64>) -> ArrayView2<'_, f64> {
    let shape = (matrix.nrows(), matrix.ncols()).f();
    ArrayView2::from_shape(shape, matrix.as_slice()).unwrap_or_else(|_| ArrayView2::from(&[[]; 0]))
}

fn view_mut(matrix: &mut DMatrix<f64>) -> ArrayViewMut2<'_, f64> {
    let shape = (matrix.nrows(), matrix.ncols()).f();
    ArrayViewMut2::from_shape(shape, matrix.as_mut_slice())
        .unwrap_or_else(|_| ArrayViewMut2::from(&mut [[]; 0]))
}

/// The blocks from `first` to `count`.
fn blocks(first: usize, count: usize) -> impl Iterator<Item = Range<usize>> {
    let each = (first..count).step_by(BLOCK);
    each.map(move |first| first..(first + BLOCK).min(count))
}

/// These rows and columns of a matrix.
fn part<S: RawData>(
    mut whole: ArrayBase<S, Ix2>,
    [rows, columns]: [&Range<usize>; 2],
) -> ArrayBase<S, Ix2> {
    whole.slice_axis_inplace(Axis(0), rows.clone().into());
    whole.slice_axis_inplace(Axis(1), columns.clone().into());
    whole
}

fn multiplied(a: &ArrayView2<'_, f64>, b: &ArrayView2<'_, f64>) -> DMatrix<f64> {
    let mut product = DMatrix::zeros(a.nrows(), b.ncols());
    general_mat_mul(1.0, a, b, 0.0, &mut view_mut(&mut product));
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

/// `a a^T`.
pub(crate) fn square(a: &DMatrix<f64>) -> DMatrix<f64> {
    let mut square = DMatrix::zeros(a.nrows(), a.nrows());
    add_upper(&view(a), &view(a).t(), &mut square);
    mirror(&mut square);
    square
}

/// Adds `a^T b`, which is symmetric, to a sum, but for blocks below its diagonal; [`mirror`] fills these in the end.
pub(crate) fn add_symmetric(a: &DMatrix<f64>, b: &DMatrix<f64>, sum: &mut DMatrix<f64>) {
    add_upper(&view(a).reversed_axes(), &view(b), sum);
}

/// Adds the blocks of `a b` on the diagonal and above.
fn add_upper(a: &ArrayView2<'_, f64>, b: &ArrayView2<'_, f64>, sum: &mut DMatrix<f64>) {
    let (count, inner) = (sum.nrows(), 0..a.ncols());
    for rows in blocks(0, count) {
        let columns = rows.start..count;
        let mut block = part(view_mut(sum), [&rows, &columns]);
        let (left, right) = (part(*a, [&rows, &inner]), part(*b, [&inner, &columns]));
        general_mat_mul(1.0, &left, &right, 1.0, &mut block);
    }
}

/// Copies what is above the diagonal of a symmetric matrix to below it.
pub(crate) fn mirror(matrix: &mut DMatrix<f64>) {
    matrix.fill_lower_triangle_with_upper_triangle();
}

/// `t^T t` of a lower triangle `t`.
pub(crate) fn square_of_triangle(triangle: &DMatrix<f64>) -> DMatrix<f64> {
    let count = triangle.nrows();
    let mut square = DMatrix::zeros(count, count);
    let t = view(triangle);
    for rows in blocks(0, count) {
        for columns in blocks(rows.start, count) {
            // Rows above are zero in these columns.
            let inner = columns.start..count;
            let (left, right) = (part(t, [&inner, &rows]), part(t, [&inner, &columns]));
            let mut block = part(view_mut(&mut square), [&rows, &columns]);
            general_mat_mul(1.0, &left.t(), &right, 0.0, &mut block);
        }
    }
    mirror(&mut square);
    square
}

/// `a t^T` with a lower triangle `t`.
pub(crate) fn by_triangle(a: &DMatrix<f64>, triangle: &DMatrix<f64>) -> DMatrix<f64> {
    let (rows, count) = (0..a.nrows(), triangle.nrows());
    let mut product = DMatrix::zeros(a.nrows(), count);
    for columns in blocks(0, count) {
        // Columns after these are zero in these rows of the triangle.
        let inner = 0..columns.end;
        let left = part(view(a), [&rows, &inner]);
        let right = part(view(triangle), [&columns, &inner]);
        let mut block = part(view_mut(&mut product), [&rows, &columns]);
        general_mat_mul(1.0, &left, &right.t(), 0.0, &mut block);
    }
    product
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

    #[test]
    fn products_of_symmetric_and_triangular_matrices_are_those_of_whole_ones() {
        // Whole numbers, so that sums in any order are the same.
        let matrix = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |j, k| ((3 * j + 7 * k) % 11) as f64 - 5.0)
        };
        for count in [1, BLOCK - 1, BLOCK, 2 * BLOCK + 7] {
            let (a, triangle) = (matrix(9, count), matrix(count, count).lower_triangle());
            assert_eq!(square(&a.transpose()), a.tr_mul(&a));
            let mut sum = DMatrix::identity(count, count);
            add_symmetric(&a, &(&a * 2.0), &mut sum);
            mirror(&mut sum);
            assert_eq!(sum, DMatrix::identity(count, count) + a.tr_mul(&a) * 2.0);
            assert_eq!(square_of_triangle(&triangle), triangle.tr_mul(&triangle));
            assert_eq!(by_triangle(&a, &triangle), &a * triangle.transpose());
        }
    }
}
