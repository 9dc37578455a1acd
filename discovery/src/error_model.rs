//! The errors of a flight, estimated from it: variance components by restricted likelihood.
//!
//! Constants (calibration of the joints, their error with the bend, the gyroscope's scale, subject and sensors) have
//! priors and are the same in all stretches. The wander of the joints, the noise of the sensors and what else pushes
//! are drawn anew in every stretch: they are never fitted, only the sizes from which they are drawn.

use std::collections::BTreeMap;
use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, SMatrix};
use rayon::prelude::*;

pub use super::error_prior::{COMPONENTS, CONSTANTS, Components, OWN, PUSH, WANDER};
use super::error_prior::{Prior, Spread, subject_precision};
use super::linearization::{Belief, Columns, Course};
use super::nuisance::{Angles, JOINTS, JointErrors, SUBJECT, Subject};
use super::product::{product, product_transposed, transposed_product};
use super::progress::Progress;
use super::stretch::{CHANNELS, NUMBERS, Stretch};

/// Groups of sensors, by channel.
const GROUP: [usize; CHANNELS] = [0, 0, 0, 1, 1, 1, 2, 2, 3];

/// Numbers of a stretch with all of which they are made.
#[derive(Clone)]
pub struct Part {
    /// Residual at zero constants, to first order.
    pub missing: DVector<f64>,
    /// Constants.
    pub constants: DMatrix<f64>,
    /// Effects.
    pub effects: DMatrix<f64>,
    /// Derivatives by a force and a moment in each window.
    pub pushes: [DMatrix<f64>; 2],
    /// Covariance of each component at a size of one.
    kernels: Arc<[DMatrix<f64>]>,
    /// Share of its weight that a stretch keeps.
    pub weight: f64,
    /// First frame of the stretch.
    first: usize,
    /// The joints, by degree of their course.
    joints: [DMatrix<f64>; 3],
    /// What the wander changes around which this is linear.
    pub wandered: DVector<f64>,
}

impl Part {
    /// Of columns around a belief.
    pub fn new(stretch: &Stretch, columns: Columns, belief: &Belief) -> Self {
        let mut kernels = Vec::with_capacity(COMPONENTS);
        let averaged = 1.0 / stretch.grid.window as f64;
        for group in 0..4 {
            let mut kernel = DMatrix::zeros(NUMBERS, NUMBERS);
            for channel in (0..CHANNELS).filter(|channel| GROUP[*channel] == group) {
                for row in (channel..NUMBERS).step_by(CHANNELS) {
                    kernel[(row, row)] += averaged;
                }
                // The measurement less the flight from a start that has a part of the same noise.
                let start = columns.start.column(channel);
                kernel += start * start.transpose() * stretch.start_variance;
                for row in 0..NUMBERS {
                    let both = start[row] * stretch.start_covariance;
                    kernel[(row, channel)] -= both;
                    kernel[(channel, row)] -= both;
                }
            }
            kernels.push(kernel);
        }
        let square = |matrix: &DMatrix<f64>| product_transposed(matrix, matrix);
        kernels.extend(columns.joints.iter().map(square));
        kernels.extend([&columns.moment, &columns.force].map(square));
        let mut constants = DMatrix::zeros(NUMBERS, CONSTANTS);
        let groups = [
            &columns.joints[0],
            &columns.bend,
            &columns.gyro,
            &columns.subject,
        ];
        let mut first = 0;
        for group in groups {
            constants.columns_mut(first, group.ncols()).copy_from(group);
            first += group.ncols();
        }
        let part = Self {
            missing: DVector::zeros(NUMBERS),
            constants,
            effects: columns.effects,
            pushes: [columns.force, columns.moment],
            kernels: kernels.into(),
            weight: 1.0,
            first: stretch.first,
            joints: columns.joints,
            wandered: DVector::zeros(NUMBERS),
        };
        part.around(&columns.missing, belief)
    }

    /// The same slopes around another belief, where so much is missing.
    pub fn around(mut self, missing: &DVector<f64>, belief: &Belief) -> Self {
        self.wandered.fill(0.0);
        if let Some(wander) = belief.wander.get(&self.first) {
            for (columns, wander) in self.joints.iter().zip(wander) {
                self.wandered += columns * wander;
            }
        }
        self.missing = missing + &self.constants * belief.constants() + &self.wandered;
        self
    }

    /// The likely wander, where the constants are known.
    fn wander(&self, errors: &Errors) -> Option<Course> {
        let left = &self.missing - &self.constants * &errors.constants;
        let pulled = self.covariance(&errors.sizes)?.solve(&left) / self.weight;
        let mut course = [Angles::zeros(); 3];
        for ((angles, columns), k) in course.iter_mut().zip(&self.joints).zip(WANDER) {
            angles.copy_from(&(columns.tr_mul(&pulled) * errors.sizes[k]));
        }
        Some(course)
    }

    /// The covariance factored.
    pub fn covariance(&self, sizes: &Components) -> Option<Cholesky<f64, Dyn>> {
        let mut covariance = DMatrix::zeros(NUMBERS, NUMBERS);
        for (kernel, size) in self.kernels.iter().zip(sizes) {
            covariance += kernel * (*size / self.weight);
        }
        covariance.cholesky()
    }
}

/// Number of joints that the tolerance of the calibration is worth.
const TOLERANCE_WEIGHT: f64 = 45.0;

/// Errors of a flight.
#[derive(Debug, Clone)]
pub struct Errors {
    /// Variances.
    pub sizes: Components,
    /// Of the constants.
    pub spread: Spread,
    /// Constants.
    pub constants: DVector<f64>,
    /// Their covariance.
    pub covariance: DMatrix<f64>,
    /// Logarithm of the likelihood, with constants integrated and the priors of the sizes.
    pub likelihood: f64,
    /// Squared residuals of each stretch, in deviations.
    pub squares: Vec<f64>,
}

impl Errors {
    /// Root mean square of the wander of a joint about an axis (rad).
    pub fn wander(&self) -> f64 {
        let squares = WANDER.iter().zip([1.0, 3.0, 5.0]);
        squares
            .map(|(k, norm)| self.sizes[*k] / norm)
            .sum::<f64>()
            .sqrt()
    }

    /// Misfit by the number of what is compared.
    pub fn misfit(&self) -> f64 {
        self.squares.iter().sum::<f64>() / (self.squares.len() * NUMBERS).max(1) as f64
    }

    /// An estimate of the constants.
    pub fn belief(&self, before: &Belief) -> Belief {
        let mut joints = JointErrors::none();
        joints.course[0].copy_from(&self.constants.rows(0, JOINTS));
        joints.bend.copy_from(&self.constants.rows(JOINTS, JOINTS));
        Belief {
            effects: before.effects.clone(),
            subject: Subject(self.constants.rows(OWN, SUBJECT).into_owned()).possible(),
            joints,
            wander: BTreeMap::new(),
        }
    }

    /// The likely wander of all stretches.
    pub fn likely_wander(&self, parts: &[Part]) -> BTreeMap<usize, Course> {
        let each = parts.par_iter();
        each.filter_map(|part| Some((part.first, part.wander(self)?)))
            .collect()
    }
}

/// Sums over the stretches for given sizes.
struct Moments {
    likelihood: f64,
    constants: DVector<f64>,
    covariance: DMatrix<f64>,
    /// By stretch: the inverse of the covariance, and the constants multiplied by it.
    weighed: Vec<(DMatrix<f64>, DMatrix<f64>)>,
}

impl Moments {
    fn new(parts: &[Part], prior: &Prior, sizes: &Components, spread: &Spread) -> Option<Self> {
        let each: Option<Vec<_>> = parts
            .par_iter()
            .map(|part| {
                let factor = part.covariance(sizes)?;
                let inverse = factor.inverse();
                let pulled = product(&inverse, &part.constants);
                let information = transposed_product(&part.constants, &pulled);
                let slope = pulled.tr_mul(&part.missing);
                let square = part.missing.dot(&(&inverse * &part.missing));
                Some((
                    inverse,
                    pulled,
                    information,
                    slope,
                    square + factor.ln_determinant(),
                ))
            })
            .collect();
        let own = spread.own_precision(&prior.tolerances);
        let subject = subject_precision(&prior.tolerances, &prior.held);
        let precision = own.iter().chain(&subject);
        let mut information = DMatrix::zeros(CONSTANTS, CONSTANTS);
        let mut sum = 0.0;
        for (k, precision) in precision.enumerate() {
            information[(k, k)] = *precision;
            sum -= precision.ln();
        }
        let mut slope = DVector::zeros(CONSTANTS);
        let mut weighed = Vec::with_capacity(parts.len());
        for (inverse, pulled, part, part_slope, part_sum) in each? {
            information += part;
            slope += part_slope;
            sum += part_sum;
            weighed.push((inverse, pulled));
        }
        let factor = information.cholesky()?;
        let constants = factor.solve(&slope);
        sum += factor.ln_determinant() - slope.dot(&constants);
        Some(Self {
            likelihood: -0.5 * sum - prior.penalty(sizes),
            constants,
            covariance: factor.inverse(),
            weighed,
        })
    }

    /// Slope and expected curvature of the likelihood in the logarithms of the sizes.
    fn slopes(
        &self,
        parts: &[Part],
        prior: &Prior,
        sizes: &Components,
    ) -> (Components, SMatrix<f64, COMPONENTS, COMPONENTS>) {
        let each: Vec<_> = parts
            .par_iter()
            .zip(&self.weighed)
            .map(|(part, (inverse, pulled))| {
                let left = inverse * &part.missing - pulled * &self.constants;
                let taken = product_transposed(&product(pulled, &self.covariance), pulled);
                let products: Vec<DMatrix<f64>> = part
                    .kernels
                    .iter()
                    .map(|kernel| product(inverse, kernel))
                    .collect();
                let mut slope = Components::zeros();
                let mut curvature = SMatrix::<f64, COMPONENTS, COMPONENTS>::zeros();
                let share = 1.0 / part.weight;
                for (k, kernel) in part.kernels.iter().enumerate() {
                    let fitted = left.dot(&(kernel * &left));
                    slope[k] = 0.5 * share * (fitted - inverse.dot(kernel) + taken.dot(kernel));
                    for j in 0..=k {
                        let both = 0.5 * share * share * products[k].dot(&products[j].transpose());
                        curvature[(j, k)] = both;
                        curvature[(k, j)] = both;
                    }
                }
                (slope, curvature)
            })
            .collect();
        let mut slope = Components::zeros();
        let mut curvature = SMatrix::<f64, COMPONENTS, COMPONENTS>::zeros();
        for (part_slope, part_curvature) in each {
            slope += part_slope;
            curvature += part_curvature;
        }
        slope.component_mul_assign(sizes);
        curvature.component_mul_assign(&(sizes * sizes.transpose()));
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
    fn spread(&self, prior: &Prior) -> Spread {
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

/// Gain of a step below which the fit ends.
const SETTLED: f64 = 0.1;

/// Fits the errors, from where another fit ended if there is one, in at most `steps` steps of Fisher's scoring, fewer
/// where the search is cancelled. None where the numbers of a stretch have no covariance.
pub fn fit(
    parts: &[Part],
    prior: &Prior,
    start: Option<&Errors>,
    steps: usize,
    progress: &dyn Progress,
) -> Option<Errors> {
    let mut sizes = start.map_or_else(|| prior.start(), |errors| errors.sizes);
    for (k, (middle, deviation)) in prior.sizes.iter().enumerate() {
        if *deviation <= 0.0 {
            sizes[k] = middle.exp();
        }
    }
    let mut spread = start.map_or_else(|| Spread::new(&prior.tolerances), |errors| errors.spread);
    let mut best = Moments::new(parts, prior, &sizes, &spread)?;
    let mut damping = 1e-3;
    for _ in 0..steps {
        if progress.is_cancelled() {
            break;
        }
        let next_spread = best.spread(prior);
        let (slope, curvature) = best.slopes(parts, prior, &sizes);
        let mut gain = None;
        for _ in 0..6 {
            let mut damped = curvature;
            for k in 0..COMPONENTS {
                damped[(k, k)] *= 1.0 + damping;
            }
            let step = damped.cholesky()?.solve(&slope);
            let next = sizes.zip_map(&step, |size, step: f64| size * step.clamp(-2.0, 2.0).exp());
            if let Some(found) = Moments::new(parts, prior, &next, &next_spread)
                && found.likelihood > best.likelihood - 1e-6
            {
                gain = Some(found.likelihood - best.likelihood);
                (sizes, spread, best) = (next, next_spread, found);
                damping *= 0.2;
                break;
            }
            damping = damping.max(1e-3) * 10.0;
        }
        if gain.is_none_or(|gain| gain < SETTLED) {
            break;
        }
    }
    let square = |(part, (inverse, _)): (&Part, &(DMatrix<f64>, DMatrix<f64>))| {
        let left = &part.missing - &part.constants * &best.constants;
        left.dot(&(inverse * &left))
    };
    Some(Errors {
        sizes,
        spread,
        likelihood: best.likelihood,
        squares: parts.iter().zip(&best.weighed).map(square).collect(),
        constants: best.constants,
        covariance: best.covariance,
    })
}
