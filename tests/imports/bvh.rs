//! The known flight as BVH files with several rest postures and joint names.

use std::fmt::Write;

use bodyflight_core::body::posture::pose;
use bodyflight_core::{Posture, Segment, SegmentArray};
use bodyflight_mvnx::xsens;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::program;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::known::{RETURNS, imported, known, largest, turned};

/// The axes of most BVH files (X left, Y up, Z forward): in body axes and, facing north, in inertial ones.
pub(crate) fn bvh_axes() -> [Matrix3<f64>; 2] {
    let columns = |x, y, z| Matrix3::from_columns(&[x, y, z]);
    [
        columns(Vector3::x(), Vector3::z(), -Vector3::y()),
        columns(Vector3::y(), Vector3::z(), Vector3::x()),
    ]
}

const JOINTS: [(Segment, &str); 16] = [
    (Segment::Pelvis, "Hips"),
    (Segment::Abdomen, "Spine"),
    (Segment::Thorax, "Spine1"),
    (Segment::Head, "Head"),
    (Segment::LeftUpperArm, "LeftArm"),
    (Segment::LeftForearm, "LeftForeArm"),
    (Segment::LeftHand, "LeftHand"),
    (Segment::RightUpperArm, "RightArm"),
    (Segment::RightForearm, "RightForeArm"),
    (Segment::RightHand, "RightHand"),
    (Segment::LeftThigh, "LeftUpLeg"),
    (Segment::LeftShank, "LeftLeg"),
    (Segment::LeftFoot, "LeftFoot"),
    (Segment::RightThigh, "RightUpLeg"),
    (Segment::RightShank, "RightLeg"),
    (Segment::RightFoot, "RightFoot"),
];

/// A BVH file of the known flight in centimetres, with joints named by `name` and the given rest posture.
pub(crate) fn written(rest: &Posture<f64>, name: impl Fn(&str) -> String) -> String {
    let [body_axes, world_axes] = bvh_axes();
    let at_rest = pose(&Subject::default().body(), rest);
    let mut text = "HIERARCHY\n".to_owned();
    joint(&mut text, &at_rest, Segment::Pelvis, 0, &name);
    let flight = known();
    let _ = write!(
        text,
        "MOTION\nFrames: {}\nFrame Time: 0.005\n",
        flight.len()
    );
    for frame in &flight {
        let segments = turned(frame);
        let rest = rest.body_from_segments();
        let world_from_joint = segments.map(|segment, turned| {
            let body_from_joint =
                body_axes.transpose() * rest[segment].to_rotation_matrix().matrix();
            world_axes.transpose()
                * turned.to_rotation_matrix().matrix()
                * body_from_joint.transpose()
        });
        let place = 100.0 * world_axes.transpose() * frame.pelvis.position.components;
        let _ = write!(text, "{:.4} {:.4} {:.4}", place.x, place.y, place.z);
        write_turns(&mut text, &world_from_joint, Segment::Pelvis);
        text.push('\n');
    }
    text
}

type Posed = SegmentArray<bodyflight_core::body::posture::PosedSegment<f64>>;

fn joint(
    text: &mut String,
    at_rest: &Posed,
    segment: Segment,
    depth: usize,
    name: &impl Fn(&str) -> String,
) {
    let [body_axes, _] = bvh_axes();
    let from = segment
        .parent()
        .map_or(at_rest[segment].joint, |parent| at_rest[parent].joint);
    let offset = 100.0 * body_axes.transpose() * (at_rest[segment].joint - from);
    let label = name(JOINTS[segment as usize].1);
    let (kind, places) = if depth == 0 {
        ("ROOT", "6 Xposition Yposition Zposition")
    } else {
        ("JOINT", "3")
    };
    let _ = write!(
        text,
        "{kind} {label}\n{{\nOFFSET {:.5} {:.5} {:.5}\nCHANNELS {places} Zrotation Xrotation Yrotation\n",
        offset.x, offset.y, offset.z
    );
    let children: Vec<Segment> = children(segment).collect();
    for child in &children {
        joint(text, at_rest, *child, depth + 1, name);
    }
    if children.is_empty() {
        text.push_str("End Site\n{\nOFFSET 0 0 5\n}\n");
    }
    text.push_str("}\n");
}

fn children(of: Segment) -> impl Iterator<Item = Segment> {
    Segment::ALL
        .into_iter()
        .filter(move |segment| segment.parent() == Some(of))
}

/// Writes the angles of a joint and its children about Z, X, Y (degrees).
fn write_turns(text: &mut String, world_from_joint: &SegmentArray<Matrix3<f64>>, segment: Segment) {
    let parent = segment
        .parent()
        .map_or_else(Matrix3::identity, |parent| world_from_joint[parent]);
    let m = parent.transpose() * world_from_joint[segment];
    let z = (-m[(0, 1)]).atan2(m[(1, 1)]);
    let x = m[(2, 1)].clamp(-1.0, 1.0).asin();
    let y = (-m[(2, 0)]).atan2(m[(2, 2)]);
    for angle in [z, x, y] {
        let _ = write!(text, " {:.4}", angle.to_degrees());
    }
    for child in children(segment) {
        write_turns(text, world_from_joint, child);
    }
}

/// The T-pose with arms lowered.
fn arms_down() -> Posture<f64> {
    let t_pose = xsens::t_pose().body_from_segments();
    Posture::from_body_rotations(&t_pose.map(|segment, rotation| {
        let name = segment.name();
        let side = match name.get(2..) {
            Some("upperarm" | "forearm" | "hand") if name.starts_with("l_") => 1.0,
            Some("upperarm" | "forearm" | "hand") => -1.0,
            _ => return *rotation,
        };
        let down = Rotation3::new(Vector3::y() * side * core::f64::consts::FRAC_PI_2);
        UnitQuaternion::from_rotation_matrix(&down) * rotation
    }))
}

#[test]
fn a_flight_survives_bvh_with_any_rest_posture_and_names() {
    let folder = tempfile::tempdir().expect("a folder");
    for (rest, prefix) in [(xsens::t_pose(), ""), (arms_down(), "mixamorig:")] {
        let file = written(&rest, |name| format!("{prefix}{name}"));
        let file = program::written(folder.path(), "jump.bvh", &file);
        let (angles, places) = imported(folder.path(), &[&file]);
        assert!(largest(&angles) < RETURNS, "{angles:?}");
        // The position of the body is midway between the thighs, where the `Hips` joint need not be.
        assert!(places < 0.02, "{places} m");
    }
    let picture = std::fs::read_to_string(folder.path().join("out/first-frame.svg"));
    assert!(picture.expect("a picture").contains("from the south"));
}
