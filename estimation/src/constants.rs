//! What the innovations of a whole flight say of numbers that are constant over it: errors of the recorded joints, and
//! offsets of muscle input and damping.

use nalgebra::{Cholesky, Const, SMatrix, SVector};

use crate::joints::DIRECTIONS;
use crate::size::{Size, Sizes};

/// Number of constants: joint errors, then offsets of muscle input and of damping over the flight, each in pitch, yaw
/// and roll.
pub const CONSTANTS: usize = DIRECTIONS + 6;

/// One number for each constant.
pub type Constants = SVector<f64, CONSTANTS>;

type Square = SMatrix<f64, CONSTANTS, CONSTANTS>;

/// Sums over innovations, for least squares.
#[derive(Clone)]
pub struct Information {
    square: Square,
    seen: Constants,
}

/// The constants as estimated from the flight.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Differences from their present values.
    pub errors: Constants,
    /// Covariance of the estimates.
    pub covariance: Square,
    /// Size of the joint errors.
    pub size: Size,
}

/// The constants if their prior deviations are known.
struct Given {
    errors: Constants,
    /// Logarithm of the likelihood of the measurements, but for what all prior deviations share.
    log_likelihood: f64,
    factor: Cholesky<f64, Const<CONSTANTS>>,
    scale: Square,
}

impl Given {
    fn covariance(&self) -> Square {
        self.scale * self.factor.inverse() * self.scale
    }
}

impl Information {
    /// Before any innovation.
    pub fn none() -> Self {
        Self {
            square: Square::zeros(),
            seen: Constants::zeros(),
        }
    }

    /// Adds an innovation with its variance, and its derivatives with respect to the constants.
    pub fn add(&mut self, effect: &Constants, innovation: f64, variance: f64) {
        self.seen += effect * (innovation / variance);
        self.square += effect * effect.transpose() / variance;
    }

    /// Adds a gradient of the log likelihood with respect to a quantity, and the derivatives of that with respect to the
    /// constants.
    pub fn pull(&mut self, effect: &Constants, gradient: f64) {
        self.seen += effect * gradient;
    }

    /// Estimates the constants, given their prior mean `expected`, relative to their present values, the possible sizes of
    /// the joint errors, and the prior deviations of the offsets: the mean over all sizes, and a covariance that includes
    /// the differences between them. `None` if the information is not finite.
    pub fn constants(
        &self,
        expected: &Constants,
        sizes: &Sizes,
        offsets: &[f64; 6],
    ) -> Option<Found> {
        let all: Vec<Given> = sizes
            .each()
            .map(|size| {
                let deviations = Constants::from_fn(|k, _| {
                    let offset = k.checked_sub(DIRECTIONS).and_then(|k| offsets.get(k));
                    offset.copied().unwrap_or(size)
                });
                self.given(expected, &deviations)
            })
            .collect::<Option<_>>()?;
        let weighed = sizes.weighed(all.iter().map(|given| given.log_likelihood));
        let mut found = Found {
            errors: Constants::zeros(),
            covariance: Square::zeros(),
            size: Size::of(&weighed),
        };
        for (given, (_, weight)) in all.iter().zip(weighed) {
            // What is hardly possible adds nothing.
            if weight > 1e-6 {
                found.errors += given.errors * weight;
                let square = given.errors * given.errors.transpose();
                found.covariance += (given.covariance() + square) * weight;
            }
        }
        found.covariance -= found.errors * found.errors.transpose();
        Some(found)
    }

    /// The constants for given prior deviations; `None` if the information is not finite.
    fn given(&self, expected: &Constants, deviations: &Constants) -> Option<Given> {
        // In units of the deviations, so that unobserved constants stay well scaled.
        let scale = Square::from_diagonal(deviations);
        let factor = (Square::identity() + scale * self.square * scale).cholesky()?;
        let before = expected.component_div(deviations);
        let pull = scale * self.seen + before;
        let solved = factor.solve(&pull);
        let determinant: f64 = factor.l_dirty().diagonal().iter().map(|v| v.ln()).sum();
        Some(Given {
            errors: scale * solved,
            log_likelihood: 0.5 * (pull.dot(&solved) - before.norm_squared()) - determinant,
            factor,
            scale,
        })
    }
}
