//! Joint names used by common programs, for BVH files without a mapping.

use std::collections::BTreeMap;

use bodyflight_core::Segment;

use super::axes::{BodyAxes, WorldAxes};
use super::bvh::Bvh;
use super::mapping::{BodyTable, Kind, Mapping, Rest, Row, World};

/// Joint names for each segment, without the side; the first one that the file has is used.
struct Names {
    pelvis: &'static [&'static str],
    abdomen: &'static [&'static str],
    thorax: &'static [&'static str],
    head: &'static [&'static str],
    arm: [&'static str; 3],
    leg: [&'static str; 3],
}

/// Known skeletons, those with more joints first.
const SKELETONS: [Names; 2] = [
    // Mixamo, MotionBuilder, the CMU library.
    Names {
        pelvis: &["Hips"],
        abdomen: &["LowerBack", "Spine"],
        thorax: &["Spine3", "Spine2", "Spine1"],
        head: &["Head", "Neck"],
        arm: ["Arm", "ForeArm", "Hand"],
        leg: ["UpLeg", "Leg", "Foot"],
    },
    // MVN and Poser.
    Names {
        pelvis: &["Hips", "Hip"],
        abdomen: &["Chest2", "Abdomen"],
        thorax: &["Chest4", "Chest3", "Chest"],
        head: &["Head", "Neck"],
        arm: ["Shoulder", "Elbow", "Wrist"],
        leg: ["Hip", "Knee", "Ankle"],
    },
];

/// The mapping for a file with the joint names of a known skeleton, otherwise `None`. The axes are those that most
/// programs write: Y up, Z forward, X left.
pub fn mapping(bvh: &Bvh) -> Option<Mapping> {
    let segments = SKELETONS.iter().find_map(|names| segments(bvh, names))?;
    let axes = |names: [&str; 3]| names.map(str::to_owned);
    Some(Mapping {
        kind: Kind::Bvh,
        world: World {
            axes: WorldAxes::try_from(axes(["west", "up", "north"])).ok()?,
            unit_m: None,
        },
        body: BodyTable {
            axes: BodyAxes::try_from(axes(["left", "up", "forward"])).ok(),
            rest: Some(Rest::Bones),
        },
        time: Default::default(),
        angles: Default::default(),
        quaternions: Default::default(),
        position: None,
        segments,
    })
}

fn segments(bvh: &Bvh, names: &Names) -> Option<BTreeMap<String, Row>> {
    let mut rows = BTreeMap::new();
    for segment in Segment::ALL {
        let name = segment.name();
        let side = match name.as_bytes() {
            [b'l', b'_', ..] => "Left",
            [b'r', b'_', ..] => "Right",
            _ => "",
        };
        let candidates: &[&str] = match name.get(2..) {
            _ if segment == Segment::Pelvis => names.pelvis,
            _ if segment == Segment::Abdomen => names.abdomen,
            _ if segment == Segment::Thorax => names.thorax,
            _ if segment == Segment::Head => names.head,
            Some("upperarm") => &names.arm[..1],
            Some("forearm") => &names.arm[1..2],
            Some("hand") => &names.arm[2..],
            Some("thigh") => &names.leg[..1],
            Some("shank") => &names.leg[1..2],
            _ => &names.leg[2..],
        };
        let joint = candidates.iter().find_map(|candidate| {
            let wanted = format!("{side}{candidate}");
            let found = bvh.joints.iter().find(|joint| {
                // Some programs prefix every name with their own: mixamorig:Hips.
                let bare = joint.name.rsplit(':').next().unwrap_or_default();
                bare.replace(['_', ' '], "").eq_ignore_ascii_case(&wanted)
            });
            found.map(|joint| joint.name.clone())
        });
        match joint {
            Some(joint) => {
                let row = Row {
                    joint: Some(joint),
                    ..Row::default()
                };
                rows.insert(name.to_owned(), row);
            }
            None if super::skeleton::is_needed(segment) => return None,
            None => {}
        }
    }
    Some(rows)
}
