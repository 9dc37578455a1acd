//! What an accelerometer measures: the force of the air per mass, where the sensor sits on the turning body.
//!
//! The prediction and its derivatives are those of the model's last interval: the change of the momenta divided by its
//! duration. So the accelerometer sees what no other sensor does: drag, the forces of the limbs, and the load that the
//! posture does not account for.

use nalgebra::{Matrix3, SVector, Vector3};

use super::state::{ATTITUDE, SPIN, STATES, VELOCITY};
use super::transition::MotionSlope;
use crate::math::{Real, small_rotation};

/// Acceleration and angular acceleration of the model over its last interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Airflow<T: Real> {
    /// Force of the air per mass (m/s2, inertial axes).
    pub force: Vector3<T>,
    /// Angular acceleration (rad/s2, body axes).
    pub turn: Vector3<T>,
}

/// The accelerometer as the model sees it.
#[derive(Debug, Clone, Copy)]
pub struct ForcePrediction<T: Real> {
    /// Predicted specific force (m/s2, body axes).
    pub force: Vector3<T>,
    inverse_duration: T,
    body_from_inertial: Matrix3<T>,
    air: Vector3<T>,
    spin: Vector3<T>,
    arm: Vector3<T>,
}

impl<T: Real> Airflow<T> {
    /// Before the first interval.
    pub fn none() -> Self {
        Self {
            force: Vector3::zeros(),
            turn: Vector3::zeros(),
        }
    }

    /// Predicts the specific force at `arm` (m, from the centre of gravity) of a body that turns at `spin` (rad/s) and
    /// has the attitude `inertial_from_body` at the end of the interval of `duration` (s).
    pub fn at(
        &self,
        arm: &Vector3<T>,
        inertial_from_body: &nalgebra::UnitQuaternion<T>,
        spin: &Vector3<T>,
        duration: T,
    ) -> ForcePrediction<T> {
        // Forces are those of the middle of the interval; seen from the body they hardly change in half of one.
        let back = small_rotation(&(spin * (-duration * T::of(0.5))));
        let body_from_inertial = (inertial_from_body * back)
            .inverse()
            .to_rotation_matrix()
            .into_inner();
        let air = body_from_inertial * self.force;
        ForcePrediction {
            force: air + self.turn.cross(arm) + spin.cross(&spin.cross(arm)),
            inverse_duration: T::one() / duration,
            body_from_inertial,
            air,
            spin: *spin,
            arm: *arm,
        }
    }
}

impl<T: Real> ForcePrediction<T> {
    /// Derivative of one axis with respect to all error coordinates, from the model's `slope` over the interval.
    pub fn slope(&self, axis: usize, slope: &MotionSlope<T>) -> SVector<T, STATES> {
        let row = self.body_from_inertial.row(axis) * self.inverse_duration;
        let mut unit = Vector3::zeros();
        unit[axis] = T::one();
        // (turn x arm) along the axis is turn . (arm x axis).
        let lever = self.arm.cross(&unit) * self.inverse_duration;
        let mut found = SVector::<T, STATES>::zeros();
        for k in 0..STATES {
            let mut sum = T::zero();
            for i in 0..3 {
                let kept = if k == VELOCITY + i {
                    T::one()
                } else {
                    T::zero()
                };
                sum += row[i] * (slope[(VELOCITY + i, k)] - kept);
                let kept = if k == SPIN + i { T::one() } else { T::zero() };
                sum += lever[i] * (slope[(SPIN + i, k)] - kept);
            }
            found[k] = sum;
        }
        // A rotation of the body turns the axes in which the air's force is seen.
        let by_turn = unit.cross(&self.air);
        let along = self.spin.dot(&self.arm);
        for k in 0..3 {
            found[ATTITUDE + k] += by_turn[k];
            let centripetal = unit[k] * along + self.spin[axis] * self.arm[k]
                - T::of(2.0) * self.arm[axis] * self.spin[k];
            found[SPIN + k] += centripetal;
        }
        found
    }
}
