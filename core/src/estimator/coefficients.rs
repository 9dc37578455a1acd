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
/// Paper eq. (ukf_state) has yaw before pitch in both halves: its first and second coefficient, and its fourth and fifth,
/// change places here.
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

/// Muscle input and damping in the order of [`StateVector`].
pub fn input_coefficients<T: Real>(inputs: &Inputs<T>) -> [T; STATES] {
    let [[a, b, c], [d, e, f]] = [inputs.muscle, inputs.damping].map(AxisCoefficients::to_array);
    [a, b, c, d, e, f]
}
