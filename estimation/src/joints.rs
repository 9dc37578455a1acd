//! Errors of the recorded joints that are constant over the flight.
//!
//! Errors about 45 joint axes change only the six components of the load at any time, and span about two dozen
//! dimensions over a flight. The directions of joint error that matter are the principal axes of these loads.

use bodyflight_core::body::posture::Posture;
use bodyflight_core::body::{Segment, SegmentArray};
use bodyflight_core::dynamics::{Dynamics, Motion, PostureSample};
use bodyflight_core::estimator::motion::posture_error::{
    JOINT_AXES, columns, covariance_of, of_segments, with_turned_segments,
};
use bodyflight_core::math::small_rotation;
use nalgebra::{SMatrix, SVector, Vector3};

/// Number of directions of joint error that are estimated. Belly flight has hardly more than a dozen. Barrel rolls have
/// more, because the body's own rotation adds to the loads: with a dozen, the errors in the other directions were
/// mistaken for muscle input, with error bars five times too small.
pub const DIRECTIONS: usize = 24;

/// One number for each direction.
pub type Directions = SVector<f64, DIRECTIONS>;

/// Load (force and moment divided by the dynamic pressure) per direction.
pub type Loads = SMatrix<f64, 6, DIRECTIONS>;

/// Number of samples that share one load from joint errors.
const SAMPLES: usize = 2;

/// Directions of joint error, and the load that each causes over the flight.
pub struct JointDirections {
    axes: SMatrix<f64, JOINT_AXES, DIRECTIONS>,
    loads: Vec<Loads>,
    /// Covariances of the load if every axis has a deviation of 1 rad.
    covariances: Vec<SMatrix<f64, 6, 6>>,
    /// Deviations of segments that are off each on its own, as multiples of 1 rad, instead of joints.
    segments: Option<SegmentArray<f64>>,
}

impl JointDirections {
    /// Computes the directions from the posture and motion at each sample of a flight; `segments` are the deviations of
    /// segments that are off each on its own, as multiples of 1 rad.
    pub fn new<'a>(
        dynamics: &Dynamics<f64>,
        segments: Option<SegmentArray<f64>>,
        flight: impl Iterator<Item = (&'a Posture<f64>, &'a Motion<f64>)>,
    ) -> Self {
        let mut covariances = Vec::new();
        let all: Vec<SMatrix<f64, 6, JOINT_AXES>> = flight
            .step_by(SAMPLES)
            .map(loads_by_axes(dynamics, segments.as_ref(), &mut covariances))
            .collect();
        let mut sum = nalgebra::DMatrix::<f64>::zeros(JOINT_AXES, JOINT_AXES);
        for loads in &all {
            // Square metres of force are weighted like cubic metres of moment, since a body measures about one metre.
            sum += loads.tr_mul(loads);
        }
        let eigen = sum.symmetric_eigen();
        let mut order: Vec<usize> = (0..JOINT_AXES).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let axes = SMatrix::from_fn(|row, column| eigen.eigenvectors[(row, order[column])]);
        let loads = all.iter().map(|loads| loads * axes).collect();
        Self {
            axes,
            loads,
            covariances,
            segments,
        }
    }

    /// Computes the loads of the same directions anew, for postures that were corrected by errors too large for the loads to
    /// be linear in them.
    pub fn renew<'a>(
        &mut self,
        dynamics: &Dynamics<f64>,
        errors: &Directions,
        flight: impl Iterator<Item = (&'a Posture<f64>, &'a Motion<f64>)>,
    ) {
        let corrected: Vec<(Posture<f64>, &Motion<f64>)> = flight
            .step_by(SAMPLES)
            .map(|(posture, motion)| (self.corrected(posture, errors), motion))
            .collect();
        self.covariances.clear();
        let flight = corrected.iter().map(|(posture, motion)| (posture, *motion));
        let loads = loads_by_axes(dynamics, self.segments.as_ref(), &mut self.covariances);
        self.loads = flight.map(loads).map(|loads| loads * self.axes).collect();
    }

    /// Root of the mean square of the turns of the joint axes (rad) by these errors.
    pub fn turn(errors: &Directions) -> f64 {
        // The directions are orthonormal.
        errors.norm() / (JOINT_AXES as f64).sqrt()
    }

    /// Covariance of the load at a sample if every axis has a deviation of 1 rad.
    pub fn covariance(&self, index: usize) -> SMatrix<f64, 6, 6> {
        let place = (index / SAMPLES).min(self.covariances.len().saturating_sub(1));
        let covariance = self.covariances.get(place);
        covariance.copied().unwrap_or_else(SMatrix::identity)
    }

    /// Loads at a sample.
    pub fn at(&self, index: usize) -> Loads {
        let place = (index / SAMPLES).min(self.loads.len().saturating_sub(1));
        self.loads.get(place).copied().unwrap_or_else(Loads::zeros)
    }

    /// The posture corrected for these errors (rad, along the directions).
    pub fn corrected(&self, posture: &Posture<f64>, errors: &Directions) -> Posture<f64> {
        let mut turns: SVector<f64, JOINT_AXES> = self.axes * errors;
        if let Some(deviations) = &self.segments {
            let all = deviations.values().skip(1);
            for (joint, deviation) in all.enumerate() {
                let mut turn = turns.fixed_rows_mut::<3>(3 * joint);
                turn *= *deviation;
            }
            return with_turned_segments(posture, &turns);
        }
        let joints = Segment::ALL.into_iter().skip(1).enumerate();
        joints.fold(*posture, |posture, (joint, segment)| {
            let turn = Vector3::new(turns[3 * joint], turns[3 * joint + 1], turns[3 * joint + 2]);
            let turned = posture.parent_from_segment(segment) * small_rotation(&turn);
            posture.with(segment, turned)
        })
    }
}

/// Loads by an error of 1 rad, or of the deviations of segments, about each axis for a posture in motion; their covariance
/// goes to `covariances`.
fn loads_by_axes<'a>(
    dynamics: &Dynamics<f64>,
    segments: Option<&SegmentArray<f64>>,
    covariances: &mut Vec<SMatrix<f64, 6, 6>>,
) -> impl FnMut((&'a Posture<f64>, &'a Motion<f64>)) -> SMatrix<f64, 6, JOINT_AXES> {
    let mut sample = PostureSample::blank();
    move |(posture, motion)| {
        let joints = columns(dynamics, posture, motion, &mut sample);
        let columns = match segments {
            Some(deviations) => of_segments(&joints, posture, deviations),
            None => joints,
        };
        covariances.push(covariance_of(&columns));
        SMatrix::from_columns(&columns)
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::body::anthropometry::{Person, Sex};
    use bodyflight_core::body::pattern;
    use bodyflight_core::estimator::motion::posture_error::load;
    use bodyflight_core::frame::{Vector, facing_north};

    use super::*;

    #[test]
    fn loads_follow_large_errors_once_they_are_computed_anew() {
        let person = Person::new(1.75, 75.0, Sex::Male);
        let dynamics = Dynamics::<f64>::paper(person.body().unwrap(), 1.0);
        let inertial_from_body = facing_north(1.4);
        let motion = Motion {
            inertial_from_body,
            position: Vector::zero(),
            velocity: inertial_from_body.inverse() * Vector::new(3.0, 1.0, -50.0),
            angular_velocity: Vector::new(0.2, 0.1, -0.3),
        };
        let posture = pattern::neutral::<f64>();
        let flight = || [(&posture, &motion)].into_iter();
        let mut directions = JointDirections::new(&dynamics, None, flight());
        let errors = Directions::from_fn(|k, _| if k.is_multiple_of(2) { 0.25 } else { -0.25 });
        let further = Directions::from_fn(|k, _| if k < 3 { 0.01 } else { 0.0 });
        let mut sample = PostureSample::blank();
        let mut at = |errors: &Directions| {
            let corrected = directions.corrected(&posture, errors);
            load(&dynamics, &corrected, &motion, &mut sample)
        };
        let expected = at(&(errors + further)) - at(&errors);
        let gap = |directions: &JointDirections| {
            (directions.at(0) * further - expected).norm() / expected.norm()
        };
        let before = gap(&directions);
        directions.renew(&dynamics, &errors, flight());
        let after = gap(&directions);
        assert!(
            after < 0.1 && before > 2.0 * after,
            "{before:.3} {after:.3}"
        );
        // A quarter radian in each of 24 directions is 10 degrees in each of 45 axes.
        let turn = JointDirections::turn(&errors).to_degrees();
        assert!((9.0..12.0).contains(&turn), "{turn}");
    }
}
