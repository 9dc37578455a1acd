//! Symmetric matrices kept as one triangle: what is read from memory for every sum takes half the time.

use core::ops::Range;

use nalgebra::{DMatrix, DVector};

/// Number of sums in which a product of vectors is added up, so that they do not wait for each other.
const SUMS: usize = 4;

/// The lower triangle of a symmetric matrix, column by column.
#[derive(Debug, Clone)]
pub struct Symmetric {
    count: usize,
    lower: Vec<f64>,
}

impl Symmetric {
    /// A matrix of zeros.
    pub(crate) fn zeros(count: usize) -> Self {
        Self {
            count,
            lower: vec![0.0; count * (count + 1) / 2],
        }
    }

    /// The matrix whose lower triangle is that of `matrix`.
    pub(crate) fn of(matrix: &DMatrix<f64>) -> Self {
        let mut lower = Self::zeros(matrix.nrows());
        for (k, place) in lower.columns() {
            let column = &matrix.as_slice()[k * lower.count..(k + 1) * lower.count];
            lower.lower[place].copy_from_slice(&column[k..]);
        }
        lower
    }

    /// Its lower triangle in a matrix that is zero above the diagonal.
    pub(crate) fn triangle(&self) -> DMatrix<f64> {
        let mut matrix = DMatrix::zeros(self.count, self.count);
        for (k, place) in self.columns() {
            let below = k * (self.count + 1)..(k + 1) * self.count;
            matrix.as_mut_slice()[below].copy_from_slice(&self.lower[place]);
        }
        matrix
    }

    /// Adds a multiple of another matrix of the same size.
    pub(crate) fn add(&mut self, other: &Self, factor: f64) {
        for (sum, other) in self.lower.iter_mut().zip(&other.lower) {
            *sum += other * factor;
        }
    }

    /// The sum of the products of all elements with those of another matrix of the same size: the trace of the product.
    pub(crate) fn dot(&self, other: &Self) -> f64 {
        let diagonal = self.columns().map(|(_, place)| place.start);
        let diagonal: f64 = diagonal.map(|k| self.lower[k] * other.lower[k]).sum();
        2.0 * dot(&self.lower, &other.lower) - diagonal
    }

    /// The product with a vector.
    pub(crate) fn times(&self, vector: &DVector<f64>) -> DVector<f64> {
        let mut product = DVector::zeros(self.count);
        let vector = vector.as_slice();
        for (k, place) in self.columns() {
            let column = &self.lower[place];
            product[k] += dot(column, &vector[k..]);
            let below = product.as_mut_slice()[k..].iter_mut().zip(column);
            for (sum, value) in below.skip(1) {
                *sum += value * vector[k];
            }
        }
        product
    }

    /// Each column, and where it is from the diagonal on.
    fn columns(&self) -> impl Iterator<Item = (usize, Range<usize>)> + use<> {
        let mut first = 0;
        let count = self.count;
        (0..count).map(move |k| {
            let begin = first;
            first += count - k;
            (k, begin..first)
        })
    }
}

/// Sum of products.
fn dot(one: &[f64], other: &[f64]) -> f64 {
    let mut sums = [0.0; SUMS];
    let (ones, others) = (one.chunks_exact(SUMS), other.chunks_exact(SUMS));
    let rest = ones
        .remainder()
        .iter()
        .zip(&other[one.len() - ones.remainder().len()..]);
    let rest: f64 = rest.map(|(a, b)| a * b).sum();
    for (one, other) in ones.zip(others) {
        for ((sum, a), b) in sums.iter_mut().zip(one).zip(other) {
            *sum += a * b;
        }
    }
    sums.iter().sum::<f64>() + rest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_triangle_does_what_the_whole_matrix_does() {
        // Whole numbers, so that sums in any order are the same.
        let whole = |shift: usize| {
            let half = DMatrix::from_fn(11, 11, |j, k| ((3 * j + 7 * k + shift) % 11) as f64);
            &half + half.transpose()
        };
        let (a, b) = (whole(0), whole(4));
        let (one, other) = (Symmetric::of(&a), Symmetric::of(&b));
        let vector = DVector::from_fn(11, |k, _| k as f64 - 4.0);
        assert_eq!(one.triangle(), a.lower_triangle());
        assert_eq!(one.times(&vector), &a * &vector);
        assert!((one.dot(&other) - a.dot(&b)).abs() < 0.5, "whole numbers");
        let mut sum = Symmetric::zeros(11);
        sum.add(&one, 2.0);
        sum.add(&other, -1.0);
        assert_eq!(sum.triangle(), (a * 2.0 - b).lower_triangle());
    }
}
