//! Unsteady flow: loads that lag behind the posture.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "force-lag",
    kind: Kind::Physics,
    form: "first-order time constant with which aerodynamic loads follow the joints",
    parameters: &[parameter("lag_s", 0.0, 0.0, 0.15)],
    source: "unsteady aerodynamics: a wake settles within a few body widths, of 0.5 m each, at 50 m/s",
    signature: "delayed loads after quick movements, while the effect of the limbs' momentum is immediate",
    confused_with: &["posture-delay"],
    separated_by: "quick movements of heavy limbs, and slow ones of light limbs",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [lag, ..] = *values;
    model.dynamics.stream.lag += lag;
}
