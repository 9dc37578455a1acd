//! The rest posture of joints, with all rotations zero: whether it is that of a body, and how limbs lie in it.

use bodyflight_core::{Segment, SegmentArray};
use nalgebra::Vector3;

use crate::skeleton::Skeleton;
use crate::tree::Tree;
use bodyflight_io::diagnostic::{Problem, Result};

/// Largest angle between the trunk of a rest posture and the vertical, and between the hips and the left direction
/// (rad).
const TRUNK: f64 = 0.6;
const HIPS: f64 = 0.8;
/// Angle between the shoulders and the left direction of the hips (rad) from which on the sides of the arms are exchanged: no
/// rest posture twists the trunk by a quarter turn.
const SHOULDERS: f64 = core::f64::consts::FRAC_PI_2;
/// Angle between a limb and its direction in the rest posture (rad) above which the import warns.
const LIMB: f64 = 0.5;

/// Limbs whose direction is given by their bones, with the segment whose joint is at the far end.
pub(crate) const LIMBS: [(Segment, Segment); 8] = [
    (Segment::LeftUpperArm, Segment::LeftForearm),
    (Segment::LeftForearm, Segment::LeftHand),
    (Segment::RightUpperArm, Segment::RightForearm),
    (Segment::RightForearm, Segment::RightHand),
    (Segment::LeftThigh, Segment::LeftShank),
    (Segment::LeftShank, Segment::LeftFoot),
    (Segment::RightThigh, Segment::RightShank),
    (Segment::RightShank, Segment::RightFoot),
];

/// Limbs that do not hang from each other as in a body, in sentences.
pub(crate) fn out_of_order(bvh: &Tree, joints: &SegmentArray<Option<usize>>) -> Vec<String> {
    let wrong = LIMBS.into_iter().filter_map(|(segment, next)| {
        let (inner, outer) = joints[segment].zip(joints[next])?;
        let name = |joint: usize| bvh.joints.get(joint).map_or("", |joint| &joint.name);
        (!bvh.hangs_from(outer, inner)).then(|| {
            format!(
                "{}, taken as {}, does not hang from {}, taken as {}: their names are exchanged",
                name(outer),
                next.name(),
                name(inner),
                segment.name()
            )
        })
    });
    wrong.collect()
}

/// Checks the rest posture of a file against the mapping, and aligns limbs with their bones if `bones` is set.
pub(crate) fn lay(
    skeleton: &mut Skeleton,
    bvh: &Tree,
    joints: &SegmentArray<Option<usize>>,
    bones: bool,
) -> Result<Vec<String>> {
    let rest = bvh.at_rest();
    let place = |segment: Segment| Some(rest.get(joints[segment]?)?.position);
    let middle = |left, right| Some((place(left)? + place(right)?) * 0.5);
    let way = |from: Option<Vector3<f64>>, to: Option<Vector3<f64>>| Some(to? - from?);
    let hips = middle(Segment::LeftThigh, Segment::RightThigh);
    let shoulders = middle(Segment::LeftUpperArm, Segment::RightUpperArm);
    let checks = [
        (
            "the shoulders are not above the hips",
            way(hips, shoulders),
            Vector3::z(),
            TRUNK,
        ),
        (
            "the left hip is not left of the right one",
            way(place(Segment::RightThigh), place(Segment::LeftThigh)),
            Vector3::x(),
            HIPS,
        ),
        (
            "the left shoulder is not left of the right one",
            way(place(Segment::RightUpperArm), place(Segment::LeftUpperArm)),
            Vector3::x(),
            SHOULDERS,
        ),
    ];
    for (what, way, expected, most) in checks {
        let (Some(way), Some(found)) = (way, way.and_then(|way| skeleton.in_body(&way))) else {
            continue;
        };
        if found.angle(&expected) > most {
            let [x, y, z]: [f64; 3] = way.normalize().into();
            let message = format!(
                "with all rotations zero, {what}, but at {x:.2}, {y:.2}, {z:.2} from there in the file's axes"
            );
            return Err(Problem::bad_input(message).at("body.axes").help(
                "use a mapping to say where the axes of the file point: [world] axes and [body] axes",
            ));
        }
    }
    let mut warnings = Vec::new();
    for (segment, next) in LIMBS {
        let Some(along) = way(place(segment), place(next)).filter(|way| way.norm() > 0.0) else {
            continue;
        };
        if bones {
            skeleton.align(segment, &along);
        } else if let Some(angle) = skeleton.angle_to(segment, &along)
            && angle > LIMB
        {
            warnings.push(format!(
                "{}: its bone is {:.0} degrees off the rest posture; rest = \"bones\" aligns the segment with its bone",
                segment.name(),
                angle.to_degrees()
            ));
        }
    }
    if bones {
        for (end, arm) in [
            (Segment::LeftHand, Segment::LeftForearm),
            (Segment::RightHand, Segment::RightForearm),
        ] {
            skeleton.follow(end, arm);
        }
    }
    Ok(warnings)
}
