//! Errors of the recorded joints.

use bodyflight_core::body::SEGMENT_COUNT;
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{SVector, UnitQuaternion, Vector3};

/// Number of joint angles: three for each segment but the pelvis.
pub(crate) const JOINTS: usize = 3 * (SEGMENT_COUNT - 1);

/// An angle of each joint (rad).
pub(crate) type Angles = SVector<f64, JOINTS>;

/// The course of joint errors over a stretch: coefficients of the Legendre polynomials of degree 0, 1, 2 (rad).
pub(crate) type Course = [Angles; 3];

/// Joint errors of a stretch. The true joint is the recorded one times a small rotation.
#[derive(Debug, Clone, PartialEq)]
pub struct JointErrors {
    /// Over the stretch.
    pub course: Course,
    /// Error proportional to the bend (fraction).
    pub bend: Angles,
}

impl JointErrors {
    /// Joints as recorded.
    pub fn none() -> Self {
        Self {
            course: [Angles::zeros(); 3],
            bend: Angles::zeros(),
        }
    }

    /// The true posture at `place`, which runs from -1 to 1 over the stretch.
    pub fn correct(&self, recorded: &Posture<f64>, place: f64) -> Posture<f64> {
        let mut posture = *recorded;
        for joint in 0..JOINTS / 3 {
            self.correct_joint(recorded, place, joint, &mut posture);
        }
        posture
    }

    /// One joint of the true posture, given by its index among the segments that have a parent.
    fn correct_joint(
        &self,
        recorded: &Posture<f64>,
        place: f64,
        joint: usize,
        posture: &mut Posture<f64>,
    ) {
        if let Some(corrected) = self.corrected_joint(recorded, place, joint) {
            posture.set(Segment::ALL[joint + 1], corrected);
        }
    }

    /// The true rotation of one joint; `None` if it is as recorded.
    pub(crate) fn corrected_joint(
        &self,
        recorded: &Posture<f64>,
        place: f64,
        joint: usize,
    ) -> Option<UnitQuaternion<f64>> {
        let segment = Segment::ALL[joint + 1];
        let part = |angles: &Angles| angles.fixed_rows::<3>(3 * joint).into_owned();
        let from_parent = recorded.parent_from_segment(segment);
        let mut turn = Vector3::zeros();
        for (angles, share) in self.course.iter().zip(legendre(place)) {
            turn += part(angles) * share;
        }
        let bend = part(&self.bend);
        if bend != Vector3::zeros() {
            turn += bend.component_mul(&from_parent.scaled_axis());
        }
        (turn != Vector3::zeros()).then(|| from_parent * small_rotation(&turn))
    }
}

/// The Legendre polynomials of degree 0, 1, 2.
pub(crate) fn legendre(x: f64) -> [f64; 3] {
    [1.0, x, 1.5 * x * x - 0.5]
}

/// Angles by which all joints are bent (rad).
pub(crate) fn bend(posture: &Posture<f64>) -> Angles {
    let mut angles = Angles::zeros();
    for (k, &segment) in Segment::ALL.iter().skip(1).enumerate() {
        let turn = posture.parent_from_segment(segment).scaled_axis();
        angles.fixed_rows_mut::<3>(3 * k).copy_from(&turn);
    }
    angles
}
