//! Shape of the arms: areas that differ by axis from those of the solids.

use super::{Description, Group, Kind, Model, PARAMETER_COUNT, parameter};
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "arm-shape",
    kind: Kind::Physics,
    form: "factors on the areas of the arms normal to each of their axes",
    parameters: &[
        parameter("x_factor", 1.0, 0.3, 3.0),
        parameter("y_factor", 1.0, 0.3, 3.0),
        parameter("z_factor", 1.0, 0.3, 3.0),
    ],
    source: "paper eq. (limbf): areas of the solids; cloth and equipment differ by side",
    signature: "loads of the arms that change as they rotate about their long axes",
    confused_with: &["drag", "forearm-drag"],
    separated_by: "arms rotated: palms down, then to the side",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    super::scale_areas(values, model, Group::Arms);
}
