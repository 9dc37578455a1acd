//! The states of the windowed filters: a coefficient of muscle input and one of damping for each axis of the body.

use nalgebra::SVector;

use crate::axis::AxisCoefficients;
use crate::dynamics::Inputs;
use crate::dynamics::residual::ResidualLoad;
use crate::math::Real;

/// Number of estimated coefficients, n.
pub const STATES: usize = 6;

/// The estimated coefficients: muscle input in pitch, yaw, roll, then damping in pitch, yaw, roll, each in the order
/// of [`AxisCoefficients`].
///
/// Paper eq. (ukf_state) has yaw before pitch in both halves. The filter computes in that order; `in_other_order`
/// converts a state when it is published.
pub type StateVector<T> = SVector<T, STATES>;

/// Converts a state vector to inputs.
#[inline]
pub fn inputs_of<T: Real>(state: &StateVector<T>) -> Inputs<T> {
    let [pitch, yaw, roll, pitch_damping, yaw_damping, roll_damping] = (*state).into();
    Inputs {
        muscle: AxisCoefficients::new(pitch, yaw, roll),
        damping: AxisCoefficients::new(pitch_damping, yaw_damping, roll_damping),
        residual: ResidualLoad::none(),
    }
}

/// Converts a state between the orders of paper eq. (ukf_state) and [`StateVector`], in either direction, by swapping
/// pitch and yaw in both halves.
///
/// The filter keeps the paper's order because the order matters: a Cholesky root spreads its sigma points depending on
/// the order of the states.
#[inline]
pub(super) fn in_other_order<T: Real>(state: &StateVector<T>) -> StateVector<T> {
    let [a, b, roll, c, d, roll_damping] = (*state).into();
    [b, a, roll, d, c, roll_damping].into()
}

/// Converts a state in the filter's own order to inputs.
#[inline]
pub(super) fn inputs_of_filter<T: Real>(state: &StateVector<T>) -> Inputs<T> {
    inputs_of(&in_other_order(state))
}

/// Returns muscle input and damping in the order of [`StateVector`].
pub fn input_coefficients<T: Real>(inputs: &Inputs<T>) -> [T; STATES] {
    let [[a, b, c], [d, e, f]] = [inputs.muscle, inputs.damping].map(AxisCoefficients::to_array);
    [a, b, c, d, e, f]
}
