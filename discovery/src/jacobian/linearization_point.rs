//! The point of linearization, and the order of the constants in vectors and matrices.

use std::collections::BTreeMap;

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Model, extended};
use nalgebra::DVector;

use crate::jacobian::subject_error::{GYRO, SUBJECT, Subject};
use crate::shooting::joint_error::{Course, JOINTS, JointErrors};
use crate::shooting::stretch::Stretch;

/// Number of constants of suit and gyroscope, which differ between flights.
pub(crate) const OWN: usize = 2 * JOINTS + GYRO;
/// Number of all constants.
pub(crate) const CONSTANTS: usize = OWN + SUBJECT;

/// The point of linearization: current estimates of everything that may be wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearizationPoint {
    /// Effects.
    pub effects: EffectSet,
    /// Errors of subject and sensors.
    pub subject: Subject,
    /// Joint calibration and joint errors proportional to the bend.
    pub joints: JointErrors,
    /// The most likely joint wander, by the first frame of a stretch. Empty until it has been estimated.
    pub wander: BTreeMap<usize, Course>,
}

impl LinearizationPoint {
    /// The point at which the files are exact.
    pub fn files() -> Self {
        Self {
            effects: EffectSet::new(),
            subject: Subject::as_in_file(),
            joints: JointErrors::none(),
            wander: BTreeMap::new(),
        }
    }

    /// The joint errors in a stretch.
    ///
    /// The derivatives of an effect depend on the joints. Taken at the recorded joints, their errors would be
    /// correlated with the residuals, and every load that follows the limbs would be underestimated (errors in
    /// variables).
    pub fn joints_in(&self, stretch: &Stretch) -> JointErrors {
        let mut joints = self.joints.clone();
        if let Some(wander) = self.wander.get(&stretch.first) {
            for (course, wander) in joints.course.iter_mut().zip(wander) {
                *course += wander;
            }
        }
        joints
    }

    /// The constants as one vector.
    pub fn constants(&self) -> DVector<f64> {
        let mut constants = DVector::zeros(CONSTANTS);
        let calibration = &self.joints.course[0];
        constants.rows_mut(0, JOINTS).copy_from(calibration);
        constants
            .rows_mut(JOINTS, JOINTS)
            .copy_from(&self.joints.bend);
        constants.rows_mut(OWN, SUBJECT).copy_from(&self.subject.0);
        constants
    }

    /// The plain model with subject and effects of this point.
    pub fn model(&self, plain: &Model<f64>) -> Model<f64> {
        self.subject.of(&extended(plain, &self.effects))
    }
}
