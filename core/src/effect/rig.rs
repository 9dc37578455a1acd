//! The rig on the back: mass and area missing in the segment table.

use super::{Description, Kind, Model, PARAMETER_COUNT, parameter};
use crate::body::Segment;
use crate::body::gear::carry_on_back;
use crate::math::Real;

pub(super) const EFFECT: Description = Description {
    name: "rig",
    kind: Kind::Physics,
    form: "a mass at the position of the rig in the equipment tables",
    parameters: &[parameter("mass_kg", 0.0, 0.0, 15.0)],
    source: "sport rigs weigh 6 to 12 kg and sit 0.15 m behind the spine",
    signature: "pitching moment with the weight and the drag on the back, faster fall",
    confused_with: &["cg-offset", "mass"],
    separated_by: "alternating belly and back attitudes",
};

pub(super) fn apply<T: Real>(values: &[T; PARAMETER_COUNT], model: &mut Model<T>) {
    let [mass, ..] = *values;
    if mass != T::zero() {
        carry_on_back(&mut model.dynamics.body.segments[Segment::Thorax], mass);
    }
}
