//! Whitened flights, with the constants marginalized out.

use std::sync::Arc;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use rayon::prelude::*;

use crate::jacobian::linearization_point::{CONSTANTS, OWN};
use crate::jacobian::subject_error::SUBJECT;
use crate::likelihood::factor::WeighedFlight;
use crate::likelihood::gemm::{product, transposed_product};
use crate::likelihood::prior::PriorDeviations;

/// A whitened problem, prepared for marginalizing the constants of its flight.
pub(crate) struct SchurComplement {
    pub(crate) weighed: Arc<WeighedFlight>,
    /// Information of the constants specific to the flight.
    own: Cholesky<f64, Dyn>,
    own_with_subject: DMatrix<f64>,
    /// Information of the subject's parameters after marginalizing these.
    subject: DMatrix<f64>,
}

impl SchurComplement {
    /// Creates the problem from weighted stretches.
    pub(crate) fn new(
        weighed: Arc<WeighedFlight>,
        prior_deviations: &PriorDeviations,
    ) -> Option<Self> {
        let information = &weighed.information;
        let mut own = information.view((0, 0), (OWN, OWN)).into_owned();
        let own_precision = prior_deviations.own_precision();
        for (k, precision) in own_precision.iter().enumerate() {
            own[(k, k)] += precision;
        }
        let own = own.cholesky()?;
        let own_with_subject = information.view((0, OWN), (OWN, SUBJECT)).into_owned();
        let subject = information
            .view((OWN, OWN), (SUBJECT, SUBJECT))
            .into_owned()
            - own_with_subject.tr_mul(&own.solve(&own_with_subject));
        Some(Self {
            weighed,
            own,
            own_with_subject,
            subject,
        })
    }

    /// Cross information of constants and columns.
    pub(crate) fn with_constants(&self, columns: &[DMatrix<f64>]) -> DMatrix<f64> {
        let count = columns.first().map_or(0, DMatrix::ncols);
        let mut with_constants = DMatrix::zeros(CONSTANTS, count);
        for (weighed, columns) in self.weighed.stretches.iter().zip(columns) {
            with_constants += transposed_product(&weighed.pulled, columns);
        }
        with_constants
    }

    /// Information of subject and columns, with the constants of the flight marginalized out.
    pub(crate) fn reduced(&self, columns: &[DMatrix<f64>]) -> DMatrix<f64> {
        let count = columns.first().map_or(0, DMatrix::ncols);
        let each: Vec<_> = self
            .weighed
            .stretches
            .par_iter()
            .zip(columns)
            .map(|(weighed, columns)| {
                (
                    transposed_product(&weighed.pulled, columns),
                    transposed_product(columns, &product(&weighed.inverse, columns)),
                )
            })
            .collect();
        let mut with_constants = DMatrix::zeros(CONSTANTS, count);
        let mut with_columns = DMatrix::zeros(count, count);
        for (constants, columns) in each {
            with_constants += constants;
            with_columns += columns;
        }
        let own = with_constants.rows(0, OWN).into_owned();
        let taken = self.own.solve(&own);
        let subject = with_constants.rows(OWN, SUBJECT) - self.own_with_subject.tr_mul(&taken);
        with_columns -= own.tr_mul(&taken);
        let mut reduced = DMatrix::zeros(SUBJECT + count, SUBJECT + count);
        reduced
            .view_mut((0, 0), (SUBJECT, SUBJECT))
            .copy_from(&self.subject);
        reduced
            .view_mut((0, SUBJECT), (SUBJECT, count))
            .copy_from(&subject);
        reduced
            .view_mut((SUBJECT, 0), (count, SUBJECT))
            .copy_from(&subject.transpose());
        reduced
            .view_mut((SUBJECT, SUBJECT), (count, count))
            .copy_from(&with_columns);
        reduced
    }
}

/// Information and slope of some columns, and the squared residual. The log-likelihood gains half of what the square is
/// reduced by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct InformationForm {
    /// Information.
    pub information: DMatrix<f64>,
    /// Slope.
    pub slope: DVector<f64>,
    /// Squared residual.
    pub square: f64,
}

impl InformationForm {
    /// Combines flights of one subject: some columns of their reduced problems, of which the last is the residual.
    pub(crate) fn joint(
        flights: &[DMatrix<f64>],
        columns: &[usize],
        precision: &DVector<f64>,
    ) -> Option<Self> {
        let size = flights.first()?.ncols();
        let mut sum = DMatrix::zeros(size, size);
        for flight in flights {
            sum += flight;
        }
        for (k, precision) in precision.iter().enumerate() {
            sum[(k, k)] += precision;
        }
        let mut kept: Vec<usize> = columns.iter().map(|column| SUBJECT + column).collect();
        kept.push(size - 1);
        let count = kept.len();
        let subject = sum
            .view((0, 0), (SUBJECT, SUBJECT))
            .into_owned()
            .cholesky()?;
        let cross = DMatrix::from_fn(SUBJECT, count, |j, k| sum[(j, kept[k])]);
        let rest = DMatrix::from_fn(count, count, |j, k| sum[(kept[j], kept[k])])
            - cross.tr_mul(&subject.solve(&cross));
        let last = count - 1;
        Some(Self {
            information: rest.view((0, 0), (last, last)).into_owned(),
            slope: rest.view((0, last), (last, 1)).column(0).into_owned(),
            square: rest[(last, last)],
        })
    }

    /// Half the squared residual after a step.
    pub(crate) fn left(&self, step: &DVector<f64>) -> f64 {
        0.5 * self.square - step.dot(&self.slope) + 0.5 * step.dot(&(&self.information * step))
    }

    /// The step that minimizes the squared residual, given standard deviations of a prior centred `from` away, and its
    /// covariance.
    pub(crate) fn solved(
        &self,
        prior: &[f64],
        from: &DVector<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let mut information = self.information.clone();
        let mut slope = self.slope.clone();
        for (k, deviation) in prior.iter().enumerate() {
            let precision = deviation.powi(-2);
            information[(k, k)] += precision;
            slope[k] -= precision * from[k];
        }
        let factor = information.cholesky()?;
        Some((factor.solve(&slope), factor.inverse()))
    }
}
