//! The state of the filter, which is the motion and its inputs, and the difference between two states.

use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3};

use crate::dynamics::interval::Interval;
use crate::dynamics::residual::ResidualLoad;
use crate::dynamics::{Inputs, State};
use crate::frame::{Rotation, Vector};
use crate::math::{Real, clamp, flushed, normalized, small_rotation};

/// Number of error coordinates.
pub const STATES: usize = 21;
/// Number of error coordinates of the motion, which come first.
pub const MOTION_STATES: usize = 9;
/// Number of error coordinates of the inputs, whose evolution does not depend on the motion.
pub const INPUT_STATES: usize = STATES - MOTION_STATES;

/// Index of the attitude error, a rotation (rad, body axes).
pub const ATTITUDE: usize = 0;
/// Index of the velocity of the centre of gravity (m/s, inertial axes).
pub const VELOCITY: usize = 3;
/// Index of the angular velocity (rad/s, body axes).
pub const SPIN: usize = 6;
/// Index of the muscle input: pitch, yaw, roll.
pub const MUSCLE: usize = 9;
/// Index of the damping: pitch, yaw, roll.
pub const DAMPING: usize = 12;
/// Index of the residual force (m2, body axes).
pub const RESIDUAL_FORCE: usize = 15;
/// Index of the residual moment (m3, body axes).
pub const RESIDUAL_MOMENT: usize = 18;

/// A small difference between two states, indexed by the constants of this module ([`ATTITUDE`] to
/// [`RESIDUAL_MOMENT`]).
pub type Difference<T> = SVector<T, STATES>;

/// Covariance of the error coordinates.
pub type Covariance<T> = SMatrix<T, STATES, STATES>;

/// Limits of muscle input and damping, far enough from any real value that they cause no bias.
const INPUT_LIMITS: [[f32; 2]; 2] = [[-12.0, 12.0], [-0.5, 30.0]];

/// Limits of the residual force (m2) and moment (m3): more than the whole body has of drag area, and that at half a metre.
const RESIDUAL_LIMITS: [f32; 2] = [2.0, 1.0];

/// Motion and inputs at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightState<T: Real> {
    /// Motion of the body.
    pub motion: State<T>,
    /// Muscle input, damping and residual load.
    pub inputs: Inputs<T>,
}

/// Returns the inputs in the order of the error coordinates.
pub fn input_vector<T: Real>(inputs: &Inputs<T>) -> SVector<T, INPUT_STATES> {
    let Inputs {
        muscle,
        damping,
        residual,
    } = inputs;
    let mut vector = SVector::<T, INPUT_STATES>::zeros();
    let parts = [
        muscle.to_vector(),
        damping.to_vector(),
        residual.force.components,
        residual.moment.components,
    ];
    for (k, part) in parts.iter().enumerate() {
        vector.fixed_rows_mut::<3>(3 * k).copy_from(part);
    }
    vector
}

/// Converts a vector made by [`input_vector`] back to inputs.
pub fn inputs_of<T: Real>(vector: &SVector<T, INPUT_STATES>) -> Inputs<T> {
    let part = |k: usize| Vector3::new(vector[3 * k], vector[3 * k + 1], vector[3 * k + 2]);
    let axes = |k: usize| [vector[3 * k], vector[3 * k + 1], vector[3 * k + 2]].into();
    Inputs {
        muscle: axes(0),
        damping: axes(1),
        residual: ResidualLoad {
            force: Vector::from_components(part(2)),
            moment: Vector::from_components(part(3)),
        },
    }
}

impl<T: Real> FlightState<T> {
    /// Returns the state that differs from this one by `difference`, in the posture of `interval`.
    pub fn moved(&self, difference: &Difference<T>, interval: &impl Interval<T>) -> Self {
        let motion = difference.fixed_rows::<MOTION_STATES>(0).into_owned();
        let inputs = difference.fixed_rows::<INPUT_STATES>(MUSCLE).into_owned();
        Self {
            motion: moved_motion(&self.motion, &motion, interval),
            inputs: inputs_of(&(input_vector(&self.inputs) + inputs)),
        }
    }

    /// Returns the difference by which `other` is [moved](FlightState::moved) from this state.
    pub fn difference(&self, other: &Self, interval: &impl Interval<T>) -> Difference<T> {
        let mut difference = Difference::<T>::zeros();
        difference
            .fixed_rows_mut::<MOTION_STATES>(0)
            .copy_from(&motion_difference(&self.motion, &other.motion, interval));
        difference
            .fixed_rows_mut::<INPUT_STATES>(MUSCLE)
            .copy_from(&(input_vector(&other.inputs) - input_vector(&self.inputs)));
        difference
    }

    /// Clamps inputs to their limits.
    pub fn limit_inputs(&mut self) {
        let within = |[low, high]: [f32; 2]| {
            move |value: T| clamp(flushed(value), T::single(low), T::single(high))
        };
        let [muscle, damping] = INPUT_LIMITS.map(within);
        self.inputs.muscle = self.inputs.muscle.map(muscle);
        self.inputs.damping = self.inputs.damping.map(damping);
        let residual = &mut self.inputs.residual;
        let [force, moment] = RESIDUAL_LIMITS.map(|limit| {
            move |value: T| clamp(flushed(value), -T::single(limit), T::single(limit))
        });
        residual.force = residual.force.map(force);
        residual.moment = residual.moment.map(moment);
    }

    /// Converts the state to another precision.
    pub fn cast<U: Real>(&self) -> FlightState<U> {
        FlightState {
            motion: self.motion.cast(),
            inputs: self.inputs.cast(),
        }
    }

    /// Returns whether every number is finite.
    pub fn is_finite(&self) -> bool {
        self.motion.is_finite() && input_vector(&self.inputs).iter().all(|v| v.is_finite())
    }
}

/// Applies `change` to a motion: rotates the body together with its angular velocity, and changes the velocities.
pub(super) fn moved_motion<T: Real>(
    state: &State<T>,
    change: &SVector<T, MOTION_STATES>,
    interval: &impl Interval<T>,
) -> State<T> {
    let part = |k: usize| Vector3::new(change[k], change[k + 1], change[k + 2]);
    let momentum = state.inertial_from_body.inverse() * state.angular_momentum;
    let turned = **state.inertial_from_body.quaternion() * *small_rotation(&part(ATTITUDE));
    let inertial_from_body = Rotation::from_quaternion(normalized(turned));
    let momentum = momentum + interval.inertia() * Vector::from_components(part(SPIN));
    State {
        inertial_from_body,
        cg_position: state.cg_position,
        linear_momentum: state.linear_momentum
            + Vector::from_components(part(VELOCITY)) * interval.mass(),
        angular_momentum: inertial_from_body * momentum,
    }
}

/// Returns the change that takes `from` to `to`, the inverse of [`moved_motion`].
pub(super) fn motion_difference<T: Real>(
    from: &State<T>,
    to: &State<T>,
    interval: &impl Interval<T>,
) -> SVector<T, MOTION_STATES> {
    let turn = turn_between(&from.inertial_from_body, &to.inertial_from_body);
    let momentum = |state: &State<T>| state.inertial_from_body.inverse() * state.angular_momentum;
    let spin = interval.inverse_inertia() * (momentum(to) - momentum(from));
    let push = (to.linear_momentum - from.linear_momentum) / interval.mass();
    let mut change = SVector::<T, MOTION_STATES>::zeros();
    for (k, part) in [
        (ATTITUDE, turn),
        (VELOCITY, push.components),
        (SPIN, spin.components),
    ] {
        change.fixed_rows_mut::<3>(k).copy_from(&part);
    }
    change
}

/// Small rotation (rad, body axes) that takes one attitude to another: accurate to third order, and along the shorter
/// way however far apart they are.
pub(super) fn turn_between<T: Real, A, B>(
    from: &Rotation<T, A, B>,
    to: &Rotation<T, A, B>,
) -> Vector3<T> {
    turned_by(&(from.quaternion().inverse() * to.quaternion()))
}

/// Rotation vector (rad) of a small rotation, accurate to third order.
pub(super) fn turned_by<T: Real>(turn: &UnitQuaternion<T>) -> Vector3<T> {
    let imaginary = turn.imag();
    let square = imaginary.norm_squared();
    // The series of 2 asin(s) / s to fourth order.
    let factor = T::of(2.0) + square * (T::of(1.0 / 3.0) + square * T::of(3.0 / 20.0));
    if turn.w < T::zero() {
        -imaginary * factor
    } else {
        imaginary * factor
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::pattern;
    use crate::dynamics::{Dynamics, Motion};
    use crate::test_body::reference_body;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_state_is_moved_by_its_difference(
            q in prop::array::uniform4(-1.0f64..1.0),
            error in prop::collection::vec(-0.1f64..0.1, STATES),
        ) {
            let Some(inertial_from_body) = Rotation::from_wxyz(q) else {
                return Ok(());
            };
            let dynamics = Dynamics::paper(reference_body(), 1.0);
            let interval = dynamics.hold(&pattern::neutral());
            let motion = Motion {
                inertial_from_body,
                position: Vector::zero(),
                velocity: Vector::new(1.0, -45.0, 3.0),
                angular_velocity: Vector::new(0.4, -2.0, 0.7),
            };
            let state = FlightState {
                motion: State::from_motion(&motion, &interval),
                inputs: Inputs::belly_turn(),
            };
            let error = Difference::from_column_slice(&error);
            let back = state.difference(&state.moved(&error, &interval), &interval);
            prop_assert!((back - error).abs().max() < 1e-6);
        }
    }
}
