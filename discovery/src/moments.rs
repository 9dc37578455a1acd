//! Likelihood, slopes and curvature of the errors for given sizes.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SMatrix};
use rayon::prelude::*;

use super::error_prior::{COMPONENTS, CONSTANTS, Components, Prior, Spread, subject_precision};
use super::nuisance::JOINTS;
use super::part::Part;
use super::product::{product, product_transposed, transposed_product};
use super::stretch::NUMBERS;

/// Number of joints that the tolerance of the calibration is worth.
const TOLERANCE_WEIGHT: f64 = 45.0;

/// A stretch in the errors of its flight.
pub(super) struct Weighed {
    /// The inverse of its covariance.
    pub(super) inverse: DMatrix<f64>,
    /// The constants multiplied by it.
    pub(super) pulled: DMatrix<f64>,
}

/// A stretch weighed, and its share of the sums.
struct Share {
    weighed: Weighed,
    information: DMatrix<f64>,
    slope: DVector<f64>,
    /// Square of what is missing and logarithm of the determinant.
    sum: f64,
}

impl Share {
    fn new(part: &Part, sizes: &Components) -> Option<Self> {
        let factor = part.covariance(sizes)?;
        let inverse = inverse(&factor);
        let pulled = product(&inverse, &part.constants);
        Some(Self {
            information: transposed_product(&part.constants, &pulled),
            slope: pulled.tr_mul(&part.missing),
            sum: part.missing.dot(&(&inverse * &part.missing)) + factor.ln_determinant(),
            weighed: Weighed { inverse, pulled },
        })
    }
}

/// The inverse of a matrix that was factored: that of the triangle, squared.
fn inverse(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let count = lower.nrows();
    let mut triangle = DMatrix::identity(count, count);
    for mut column in triangle.as_mut_slice().chunks_exact_mut(count) {
        let mut first = count - column.len();
        // A column of the inverse is zero above the diagonal.
        while let Some((value, below)) = column.split_first_mut() {
            if *value != 0.0 {
                let pivots = &lower.as_slice()[first * count + first..(first + 1) * count];
                *value /= pivots[0];
                for (below, pivot) in below.iter_mut().zip(&pivots[1..]) {
                    *below -= *value * pivot;
                }
            }
            column = below;
            first += 1;
        }
    }
    transposed_product(&triangle, &triangle)
}

/// Sums over the stretches for given sizes.
pub(super) struct Moments {
    pub(super) likelihood: f64,
    /// The same with what is believed of calibration and bend, which is what steps raise.
    pub(super) objective: f64,
    pub(super) constants: DVector<f64>,
    pub(super) covariance: DMatrix<f64>,
    /// Of the constants, without what is believed of them.
    pub(super) information: DMatrix<f64>,
    /// By stretch.
    pub(super) weighed: Vec<Weighed>,
}

/// Square root of the factor on a curvature that makes a step in the logarithm of one size end at the maximum.
///
/// Where the numbers of a size are `r` times as large as it says, the slope is `n (r - 1) / 2` and the curvature `n r / 2`,
/// so that a step overshoots by far where `r` is small. With half the slope less it is `2 (r - 1) / (r + 1)`, the logarithm
/// of `r` to third order.
fn scale(slope: f64, curvature: f64) -> f64 {
    if curvature > 0.0 {
        (1.0 - 0.5 * slope / curvature).max(0.25).sqrt()
    } else {
        1.0
    }
}

/// What [`Moments::spread`] pays for sizes of calibration and bend away from the tolerances.
fn penalty(spread: &Spread, prior: &Prior) -> f64 {
    let tolerance = Spread::new(&prior.tolerances);
    let of = |size: f64, middle: f64| size.ln() + 0.5 * (middle / size).powi(2);
    TOLERANCE_WEIGHT
        * (of(spread.calibration, tolerance.calibration) + of(spread.bend, tolerance.bend))
}

/// Slope and curvature.
type Slopes = (Components, SMatrix<f64, COMPONENTS, COMPONENTS>);

impl Moments {
    pub(super) fn new(
        parts: &[Part],
        prior: &Prior,
        sizes: &Components,
        spread: &Spread,
    ) -> Option<Self> {
        let each: Option<Vec<Share>> = parts
            .par_iter()
            .map(|part| Share::new(part, sizes))
            .collect();
        let mut information = DMatrix::zeros(CONSTANTS, CONSTANTS);
        let mut slope = DVector::zeros(CONSTANTS);
        let mut sum = 0.0;
        let mut weighed = Vec::with_capacity(parts.len());
        for share in each? {
            information += share.information;
            slope += share.slope;
            sum += share.sum;
            weighed.push(share.weighed);
        }
        let own = spread.own_precision(&prior.tolerances);
        let subject = subject_precision(&prior.tolerances, &prior.held);
        let mut with_prior = information.clone();
        for (k, precision) in own.iter().chain(&subject).enumerate() {
            with_prior[(k, k)] += precision;
            sum -= precision.ln();
        }
        let factor = with_prior.cholesky()?;
        let constants = factor.solve(&slope);
        sum += factor.ln_determinant() - slope.dot(&constants);
        let likelihood = -0.5 * sum - prior.penalty(sizes);
        Some(Self {
            likelihood,
            objective: likelihood - penalty(spread, prior),
            constants,
            covariance: inverse(&factor),
            information,
            weighed,
        })
    }

    /// Slope and curvature of the likelihood in the logarithms of the sizes.
    ///
    /// The curvature is the mean of the expected and the observed one (Gilmour, Thompson and Cullis 1995), which takes
    /// vectors where the others take products of matrices, scaled by [`scale`].
    pub(super) fn slopes(&self, parts: &[Part], prior: &Prior, sizes: &Components) -> Slopes {
        let each: Vec<_> = parts
            .par_iter()
            .zip(&self.weighed)
            .map(|(part, weighed)| {
                let Weighed { inverse, pulled } = weighed;
                let left = inverse * &part.missing - pulled * &self.constants;
                let taken = product_transposed(&product(pulled, &self.covariance), pulled);
                let rest = inverse - taken;
                let share = 1.0 / part.weight;
                let mut slope = Components::zeros();
                let mut changes = DMatrix::zeros(NUMBERS, COMPONENTS);
                for (k, kernel) in part.kernels.iter().enumerate() {
                    let change = kernel * &left * share;
                    slope[k] = 0.5 * (left.dot(&change) - share * rest.dot(kernel));
                    changes.set_column(k, &change);
                }
                let of_constants = transposed_product(pulled, &changes);
                let square = transposed_product(&changes, &product(inverse, &changes));
                (slope, of_constants, square)
            })
            .collect();
        let mut slope = Components::zeros();
        let mut of_constants = DMatrix::zeros(CONSTANTS, COMPONENTS);
        let mut square = DMatrix::zeros(COMPONENTS, COMPONENTS);
        for (part_slope, part_constants, part_square) in each {
            slope += part_slope;
            of_constants += part_constants;
            square += part_square;
        }
        square -= of_constants.tr_mul(&(&self.covariance * &of_constants));
        let mut curvature = SMatrix::<f64, COMPONENTS, COMPONENTS>::from_fn(|j, k| {
            0.5 * square[(j, k)] * sizes[j] * sizes[k]
        });
        slope.component_mul_assign(sizes);
        let scales = Components::from_fn(|k, _| scale(slope[k], curvature[(k, k)]));
        curvature.component_mul_assign(&(scales * scales.transpose()));
        for (k, (middle, deviation)) in prior.sizes.iter().enumerate() {
            if *deviation > 0.0 {
                slope[k] -= (sizes[k].ln() - middle) / (deviation * deviation);
                curvature[(k, k)] += 1.0 / (deviation * deviation);
            } else {
                slope[k] = 0.0;
                curvature.row_mut(k).fill(0.0);
                curvature.column_mut(k).fill(0.0);
                curvature[(k, k)] = 1.0;
            }
        }
        (slope, curvature)
    }

    /// Sizes of calibration and bend by expectation and maximization, held by the tolerances.
    pub(super) fn spread(&self, prior: &Prior) -> Spread {
        let tolerance = Spread::new(&prior.tolerances);
        let share = |first: usize, before: f64| {
            let expected = (first..first + JOINTS)
                .map(|k| self.constants[k].powi(2) + self.covariance[(k, k)])
                .sum::<f64>();
            let held = TOLERANCE_WEIGHT * before * before;
            ((expected + held) / (JOINTS as f64 + TOLERANCE_WEIGHT)).sqrt()
        };
        Spread {
            calibration: share(0, tolerance.calibration),
            bend: share(JOINTS, tolerance.bend),
        }
    }
}
