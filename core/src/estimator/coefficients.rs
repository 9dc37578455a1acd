//! What the windowed filters estimate: a coefficient of muscle input and one of damping for each axis of the body.

use nalgebra::SVector;

use crate::axis::AxisCoefficients;
use crate::dynamics::Inputs;
use crate::dynamics::residual::ResidualLoad;
use crate::math::Real;

/// Number of coefficients, n.
pub const STATES: usize = 6;

/// Coefficients: muscle input in pitch, yaw, roll, then damping in pitch, yaw, roll, each in the order of
/// [`AxisCoefficients`].
///
/// Paper eq. (ukf_state) has yaw before pitch in both halves; the filter computes in that order, which `in_other_order`
/// takes to this one where a state comes out.
pub type StateVector<T> = SVector<T, STATES>;

/// The inputs that a state vector stands for.
#[inline]
pub fn inputs_of<T: Real>(state: &StateVector<T>) -> Inputs<T> {
    let [pitch, yaw, roll, pitch_damping, yaw_damping, roll_damping] = (*state).into();
    Inputs {
        muscle: AxisCoefficients::new(pitch, yaw, roll),
        damping: AxisCoefficients::new(pitch_damping, yaw_damping, roll_damping),
        residual: ResidualLoad::none(),
    }
}

/// A state in the order of paper eq. (ukf_state), from that of [`StateVector`], or the way back: pitch and yaw change places
/// in both halves.
///
/// The filter keeps the paper's order because another one is another filter: a Cholesky root spreads its sigma points by
/// the order of the states.
#[inline]
pub(super) fn in_other_order<T: Real>(state: &StateVector<T>) -> StateVector<T> {
    let [a, b, roll, c, d, roll_damping] = (*state).into();
    [b, a, roll, d, c, roll_damping].into()
}

/// The inputs that a state stands for that is in the filter's own order.
#[inline]
pub(super) fn inputs_of_filter<T: Real>(state: &StateVector<T>) -> Inputs<T> {
    inputs_of(&in_other_order(state))
}

/// Muscle input and damping in the order of [`StateVector`].
pub fn input_coefficients<T: Real>(inputs: &Inputs<T>) -> [T; STATES] {
    let [[a, b, c], [d, e, f]] = [inputs.muscle, inputs.damping].map(AxisCoefficients::to_array);
    [a, b, c, d, e, f]
}
