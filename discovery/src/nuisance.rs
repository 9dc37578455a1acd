//! What joints and subject may have wrong without an effect being missing: calibration of the suit, mass, inertia and
//! areas in the subject's file, coefficients. Nuisances of every fit, each with a prior
//! (Brynjarsdottir and O'Hagan: without priors a discrepancy and the parameters cannot be told apart).

use bodyflight_core::effect::{Effect, Model, PARAMETER_COUNT};
use bodyflight_core::math::small_rotation;
use bodyflight_core::{Posture, Segment};
use nalgebra::{DVector, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// Standard deviation of the calibration of a joint about one axis (rad): the suit's 2 degrees.
const JOINT: f64 = 0.02;

/// Standard deviations of mass and inertia of the body and of the area of each segment (share).
const MASS: f64 = 0.03;
const INERTIA: f64 = 0.03;
const AREA: f64 = 0.03;

/// Standard deviations of coefficients (share) and of the centre of gravity of the trunk (m).
const COEFFICIENTS: [(Effect, f64); 5] = [
    (Effect::Drag, 0.04),
    (Effect::Lift, 0.04),
    (Effect::Moment, 0.04),
    (Effect::Damping, 0.04),
    (Effect::CgOffset, 0.004),
];

/// Joints, by the segment behind them, and axes.
const JOINTS: usize = 3 * (SEGMENTS - 1);
const SEGMENTS: usize = bodyflight_core::body::SEGMENT_COUNT;
const BODY: usize = JOINTS + 2;
const COEFFICIENT: usize = BODY + SEGMENTS;

/// Numbers of a [`Nuisance`].
pub const COUNT: usize = COEFFICIENT + COEFFICIENTS.len() * PARAMETER_COUNT;

/// What is wrong with joints and subject, each in its standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Nuisance(pub DVector<f64>);

impl Nuisance {
    /// Everything is as the files say.
    pub fn none() -> Self {
        Self(DVector::zeros(COUNT))
    }

    /// A draw.
    pub fn drawn(random: &mut impl Rng) -> Self {
        Self(DVector::from_fn(COUNT, |_, _| {
            random.sample::<f64, _>(StandardNormal)
        }))
    }

    /// With one more thing wrong by a standard deviation.
    pub fn with(&self, index: usize) -> Self {
        let mut other = self.clone();
        other.0[index] += 1.0;
        other
    }

    /// The joints as they are where they are recorded as in `posture`.
    pub fn joints(&self) -> impl Fn(&Posture<f64>) -> Posture<f64> + use<> {
        let turns: Vec<(Segment, UnitQuaternion<f64>)> = Segment::ALL
            .iter()
            .skip(1)
            .zip(self.0.as_slice().chunks_exact(3))
            .filter(|(_, turn)| turn.iter().any(|angle| *angle != 0.0))
            .map(|(&segment, turn)| {
                (
                    segment,
                    small_rotation(&(Vector3::from_column_slice(turn) * JOINT)),
                )
            })
            .collect();
        move |recorded| {
            let mut posture = *recorded;
            for &(segment, turn) in &turns {
                posture.set(segment, posture.parent_from_segment(segment) * turn);
            }
            posture
        }
    }

    /// Whether the same is wrong with the joints.
    pub fn has_joints_of(&self, other: &Self) -> bool {
        let joints = |nuisance: &Self| nuisance.0.rows(0, JOINTS).into_owned();
        joints(self) == joints(other)
    }

    /// The model with the subject as it is.
    pub fn of(&self, model: &Model<f64>) -> Model<f64> {
        let mut other = *model;
        let share = |index: usize, deviation: f64| (1.0 + self.0[index] * deviation).max(0.1);
        let (mass, inertia) = (share(JOINTS, MASS), share(JOINTS + 1, INERTIA));
        for (k, (_, segment)) in other.dynamics.body.segments.iter_mut().enumerate() {
            segment.mass *= mass;
            segment.inertia *= mass * inertia;
            segment.area *= share(BODY + k, AREA);
        }
        for (row, (effect, deviation)) in COEFFICIENTS.iter().enumerate() {
            let mut values = effect.neutral();
            for (k, (value, parameter)) in values
                .iter_mut()
                .zip(effect.description().parameters)
                .enumerate()
            {
                *value += self.0[COEFFICIENT + row * PARAMETER_COUNT + k] * deviation;
                *value = value.clamp(parameter.low, parameter.high);
            }
            // Kept inside the plausible ranges.
            let _ = effect.apply(&values, &mut other);
        }
        other
    }
}

#[cfg(test)]
mod tests {
    use bodyflight_core::body::pattern;

    use super::*;
    use crate::test_subject;

    #[test]
    fn nothing_wrong_changes_nothing_and_each_number_changes_one_thing() {
        let dynamics = test_subject::dynamics();
        let model = Model::new(dynamics, 0.0);
        let posture = pattern::neutral();
        let nothing = Nuisance::none();
        assert_eq!(nothing.of(&model), model);
        assert_eq!(nothing.joints()(&posture), posture);
        for k in 0..COUNT {
            let nuisance = nothing.with(k);
            let turned = nuisance.joints()(&posture) != posture;
            assert_eq!(turned, k < JOINTS, "{k}");
            assert_eq!(nuisance.of(&model) != model, k >= JOINTS, "{k}");
        }
        let heavier = nothing.with(JOINTS).of(&model).dynamics.body.mass();
        assert!((heavier / dynamics.body.mass() - 1.0 - MASS).abs() < 1e-12);
        let left = nothing.with(3 * (Segment::LeftThigh as usize - 1) + 1);
        let angle = left.joints()(&posture)
            .parent_from_segment(Segment::LeftThigh)
            .angle_to(posture.parent_from_segment(Segment::LeftThigh));
        assert!((angle - JOINT).abs() < 1e-4, "{angle}");
    }
}
