//! Shape of trunk and head: areas that differ by axis from those of the solids.

use super::{Description, Group, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "trunk-shape",
    kind: Kind::Physics,
    form: "factors on the areas of trunk and head normal to each of their axes",
    parameters: &[
        parameter("x_factor", 1.0, 0.3, 3.0),
        parameter("y_factor", 1.0, 0.3, 3.0),
        parameter("z_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf): areas of the solids; cloth and equipment differ by side",
    signature: "loads whose ratio between belly, side and head-down attitudes differs from the model's",
    confused_with: &["drag", "rig-size", "mass"],
    separated_by: "belly, side, head-down and sit one after another",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    super::scale_areas(values, model, Group::Trunk);
}
