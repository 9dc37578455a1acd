//! Which segments carry sensors in sets of common sizes.

use crate::body::Segment;

use Segment::{
    Head, LeftFoot, LeftForearm, LeftShank, LeftThigh, LeftUpperArm, Pelvis, RightFoot,
    RightForearm, RightShank, RightThigh, RightUpperArm, Thorax,
};

/// Sets by their number of sensors, in order of size. Fewer than eight leave so much open that their postures are a
/// demonstration.
pub const SETS: [&[Segment]; 5] = [
    &[Pelvis, LeftForearm, RightForearm, LeftShank, RightShank],
    &[
        Pelvis,
        Thorax,
        LeftUpperArm,
        RightUpperArm,
        LeftThigh,
        LeftShank,
        RightThigh,
        RightShank,
    ],
    &[
        Pelvis,
        Thorax,
        LeftUpperArm,
        LeftForearm,
        RightUpperArm,
        RightForearm,
        LeftThigh,
        LeftShank,
        RightThigh,
        RightShank,
    ],
    &[
        Pelvis,
        Thorax,
        Head,
        LeftUpperArm,
        LeftForearm,
        RightUpperArm,
        RightForearm,
        LeftThigh,
        LeftShank,
        LeftFoot,
        RightThigh,
        RightShank,
        RightFoot,
    ],
    &Segment::ALL,
];

/// The set of this many sensors.
pub fn of_size(count: usize) -> Option<&'static [Segment]> {
    SETS.into_iter().find(|set| set.len() == count)
}
