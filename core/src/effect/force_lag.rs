//! Unsteady flow: loads that lag behind the posture.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "force-lag",
    kind: Kind::Physics,
    form: "time by which the loads of the air follow the joints, to first order",
    parameters: &[parameter("lag_s", 0.0, 0.0, 0.15)],
    source: "unsteady aerodynamics: a wake settles over some widths of the body, 0.5 m at 50 m/s each",
    signature: "loads late after quick movements, while what limbs do by their momentum comes at once",
    confused_with: &["posture-delay"],
    separated_by: "quick movements of heavy limbs beside slow ones of light limbs",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [lag, ..] = *values;
    model.dynamics.stream.lag += lag;
}
