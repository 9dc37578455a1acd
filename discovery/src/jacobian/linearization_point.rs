//! The point of linearization, and the order of the constants in vectors and matrices.

use std::collections::BTreeMap;

use crate::named_effect::EffectSet;
use bodyflight_core::effect::{Model, extended};
use nalgebra::DVector;

use crate::jacobian::subject_error::{GYRO, SUBJECT, Subject};
use crate::shooting::joint_error::{Course, JOINTS, JointErrors};
use crate::shooting::stretch::{Channels, Stretch};

/// Number of constants of suit and gyroscope, which differ between flights.
pub(crate) const OWN: usize = 2 * JOINTS + GYRO;
/// Number of all constants.
pub(crate) const CONSTANTS: usize = OWN + SUBJECT;

/// The most likely values of what differs from stretch to stretch.
#[derive(Debug, Clone, PartialEq)]
pub struct StretchErrors {
    /// Wander of the joints.
    pub(crate) wander: Course,
    /// True motion at the start less the smoothed one.
    pub(crate) start: Channels,
}

/// The point of linearization: current estimates of everything that may be wrong.
#[derive(Debug, Clone, PartialEq)]
pub struct LinearizationPoint {
    /// Effects.
    pub effects: EffectSet,
    /// Errors of subject and sensors.
    pub subject: Subject,
    /// Joint calibration and joint errors proportional to the bend.
    pub joints: JointErrors,
    /// The most likely errors of each stretch, by its first frame. Empty until they have been estimated.
    pub stretches: BTreeMap<usize, StretchErrors>,
}

impl LinearizationPoint {
    /// The point at which the files are exact.
    pub fn files() -> Self {
        Self {
            effects: EffectSet::new(),
            subject: Subject::as_in_file(),
            joints: JointErrors::none(),
            stretches: BTreeMap::new(),
        }
    }

    /// The same with effects in the model.
    pub fn files_with(effects: &EffectSet) -> Self {
        Self {
            effects: effects.clone(),
            ..Self::files()
        }
    }

    /// The joint errors in a stretch.
    ///
    /// The derivatives of an effect depend on the joints. Taken at the recorded joints, their errors would be
    /// correlated with the residuals, and every load that follows the limbs would be underestimated (errors in
    /// variables).
    pub fn joints_in(&self, stretch: &Stretch) -> JointErrors {
        let mut joints = self.joints.clone();
        if let Some(errors) = self.stretches.get(&stretch.first) {
            for (course, wander) in joints.course.iter_mut().zip(&errors.wander) {
                *course += wander;
            }
        }
        joints
    }

    /// The error of a stretch's smoothed start.
    ///
    /// A fast roll turns the noise of its start into differences that are far from proportional to it; taken at the
    /// smoothed start, they once looked like a mass that was wrong by 7 %.
    pub(crate) fn start_in(&self, stretch: &Stretch) -> Channels {
        let errors = self.stretches.get(&stretch.first);
        errors.map_or_else(Channels::zeros, |errors| errors.start)
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
