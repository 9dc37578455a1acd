//! Likelihood of the errors for given variances, with slope and curvature.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, SMatrix};
use rayon::prelude::*;

use crate::jacobian::layout::{COMPONENTS, Components};
use crate::jacobian::linearization_point::CONSTANTS;
use crate::jacobian::symmetric::Symmetric;
use crate::likelihood::factor::{
    StretchFactor, TOGETHER, WeighedFlight, WeightedStretch, inverse_triangle,
};
use crate::likelihood::gemm::{
    by_triangle, product, square, square_of_triangle, transposed_product,
};
use crate::likelihood::prior::{Prior, PriorDeviations, subject_precision};
use crate::shooting::joint_error::JOINTS;

/// Weight of the tolerances when the spread of the joint errors is estimated: they count as much as this many joint
/// angles.
const TOLERANCE_WEIGHT: f64 = 45.0;

/// Sums over the stretches for given variances.
pub(crate) struct RemlEvaluation {
    /// Log-likelihood with the constants marginalized out, and with the priors of all variances. The fit maximizes this.
    pub(crate) likelihood: f64,
    pub(crate) constants: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
    prior_deviations: PriorDeviations,
    /// A lower triangle of which the covariance is the square, the transpose first.
    triangle: DMatrix<f64>,
    pub(crate) weighed: Arc<WeighedFlight>,
}

/// Square root of the factor on the curvature that makes a step in one log-variance end near the maximum.
///
/// If squared residuals are `r` times as large as a variance predicts, the slope is `n (r - 1) / 2` and the curvature
/// `n r / 2`, so for small `r` a step overshoots by far. Subtracting half the slope from the curvature gives the step
/// `2 (r - 1) / (r + 1)`, which is the logarithm of `r` to third order.
fn scale(slope: f64, curvature: f64) -> f64 {
    if curvature > 0.0 {
        (1.0 - 0.5 * slope / curvature).max(0.25).sqrt()
    } else {
        1.0
    }
}

/// Penalty of [`RemlEvaluation::prior_deviations`] for deviations of calibration and bend that depart from the tolerances.
fn penalty(prior_deviations: &PriorDeviations, prior: &Prior) -> f64 {
    let tolerance = PriorDeviations::new(&prior.tolerances);
    let of = |size: f64, middle: f64| size.ln() + 0.5 * (middle / size).powi(2);
    TOLERANCE_WEIGHT
        * (of(prior_deviations.calibration, tolerance.calibration)
            + of(prior_deviations.bend, tolerance.bend))
}

/// Slope and curvature.
type Slopes = (Components, SMatrix<f64, COMPONENTS, COMPONENTS>);

impl RemlEvaluation {
    pub(crate) fn new(
        parts: &[StretchFactor],
        prior: &Prior,
        sizes: &Components,
        prior_deviations: &PriorDeviations,
    ) -> Option<Self> {
        let weighed = WeighedFlight::new(parts, sizes)?;
        Self::of(weighed, parts, prior, sizes, prior_deviations)
    }

    /// The same for a flight that is weighted already.
    pub(crate) fn of(
        weighed: Arc<WeighedFlight>,
        parts: &[StretchFactor],
        prior: &Prior,
        sizes: &Components,
        prior_deviations: &PriorDeviations,
    ) -> Option<Self> {
        let share = |(parts, weighed): (&[StretchFactor], &[WeightedStretch])| {
            let (mut slope, mut sum) = (DVector::zeros(CONSTANTS), 0.0);
            for (part, weighed) in parts.iter().zip(weighed) {
                slope += weighed.pulled.tr_mul(&part.residual);
                let square = part.residual.dot(&(&weighed.inverse * &part.residual));
                sum += square + weighed.ln_determinant;
            }
            (slope, sum)
        };
        let chunks = parts.par_chunks(TOGETHER);
        let chunks = chunks.zip(weighed.stretches.par_chunks(TOGETHER));
        let each: Vec<(DVector<f64>, f64)> = chunks.map(share).collect();
        let mut slope = DVector::zeros(CONSTANTS);
        // Whitened squared residuals plus the logarithms of the determinants.
        let mut sum = 0.0;
        for (of_share, share) in each {
            slope += of_share;
            sum += share;
        }
        let own = prior_deviations.own_precision();
        let subject = subject_precision(&prior.tolerances, &prior.fixed);
        let mut with_prior = weighed.information.clone();
        for (k, precision) in own.iter().chain(&subject).enumerate() {
            with_prior[(k, k)] += precision;
            sum -= precision.ln();
        }
        let factor = with_prior.cholesky()?;
        let constants = factor.solve(&slope);
        sum += factor.ln_determinant() - slope.dot(&constants);
        let priors = prior.penalty(sizes) + penalty(prior_deviations, prior);
        let triangle = inverse_triangle(&factor);
        Some(Self {
            likelihood: -0.5 * sum - priors,
            constants,
            prior_deviations: *prior_deviations,
            covariance: square_of_triangle(&triangle),
            triangle,
            weighed,
        })
    }

    /// Slope and curvature of the likelihood in the log-variances.
    ///
    /// The curvature is the average of expected and observed information (Gilmour, Thompson and Cullis 1995), which
    /// needs only matrix-vector products where the other two need products of matrices, scaled by [`scale`].
    pub(crate) fn slopes(
        &self,
        parts: &[StretchFactor],
        prior: &Prior,
        sizes: &Components,
    ) -> Slopes {
        let (mut slope, mut curvature) = self.by_variance(parts);
        for j in 0..COMPONENTS {
            for k in 0..COMPONENTS {
                curvature[(j, k)] *= sizes[j] * sizes[k];
            }
        }
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

    /// Slope and curvature of the likelihood in the sizes themselves, without their priors.
    pub(crate) fn by_variance(&self, parts: &[StretchFactor]) -> Slopes {
        let each: Vec<_> = parts
            .par_iter()
            .zip(&self.weighed.stretches)
            .map(|(part, weighed)| {
                let WeightedStretch {
                    inverse, pulled, ..
                } = weighed;
                let left = inverse * &part.residual - pulled * &self.constants;
                let taken = square(&by_triangle(pulled, &self.triangle));
                let rest = Symmetric::of(&(inverse - taken));
                let share = 1.0 / part.weight;
                let mut slope = Components::zeros();
                let mut changes = DMatrix::zeros(left.len(), COMPONENTS);
                for (k, kernel) in part.kernels() {
                    let change = kernel.times(&left) * share;
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
        let curvature =
            SMatrix::<f64, COMPONENTS, COMPONENTS>::from_fn(|j, k| 0.5 * square[(j, k)]);
        (slope, curvature)
    }

    /// Standard deviations of calibration and bend, regularized by the tolerances: by a step of the fixed point of MacKay
    /// (1992), and by a step of expectation maximization, which is slow where the flight tells little about most joints,
    /// but never makes it less likely.
    pub(crate) fn prior_deviations(&self, prior: &Prior) -> [PriorDeviations; 2] {
        let tolerance = PriorDeviations::new(&prior.tolerances);
        let limit = prior.tolerances.joint_limit_deg().to_radians();
        let share = |first: usize, now: f64, before: f64| {
            let joints = first..first + JOINTS;
            let squares: f64 = joints.clone().map(|k| self.constants[k].powi(2)).sum();
            let left: f64 = joints.map(|k| self.covariance[(k, k)]).sum();
            let fixed = TOLERANCE_WEIGHT * before * before;
            let count = JOINTS as f64 + TOLERANCE_WEIGHT;
            let told = count - left / (now * now);
            [(squares + fixed) / told, (squares + left + fixed) / count]
                .map(|square| square.sqrt().min(limit))
        };
        let now = &self.prior_deviations;
        let calibration = share(0, now.calibration, tolerance.calibration);
        // At a bend of one radian, the limit is the same error.
        let bend = share(JOINTS, now.bend, tolerance.bend);
        [0, 1].map(|k| PriorDeviations {
            calibration: calibration[k],
            bend: bend[k],
        })
    }
}
