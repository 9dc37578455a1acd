//! Motion of the body model SMPL and its successors SMPL-H and SMPL-X, as the AMASS collection distributes it: an
//! archive of NumPy arrays with a rotation vector for each joint, relative to its parent.
//!
//! The rest posture is the T-pose. The lengths of bones follow from a body model that is not in the file; only
//! rotations and the path of the pelvis are read.

use nalgebra::{UnitQuaternion, Vector3};

use crate::archive::Archive;
use crate::axes::WorldAxes;
use crate::mapping::Mapping;
use crate::names;
use crate::numpy::Array;
use crate::tree::Tree;
use bodyflight_io::diagnostic::{Problem, Result};

/// The joints of the body, in the order of all models of the family: name, parent, and offset from the parent in the
/// rest posture (m; X left, Y up, Z forward). The offsets are those of the mean adult, rounded to a centimetre: they
/// give the directions of the bones, and the place of the hips below the pelvis joint.
const JOINTS: [(&str, Option<usize>, [f64; 3]); 22] = [
    ("pelvis", None, [0.0, 0.0, 0.0]),
    ("left_hip", Some(0), [0.07, -0.09, -0.01]),
    ("right_hip", Some(0), [-0.07, -0.09, -0.01]),
    ("spine1", Some(0), [0.0, 0.11, -0.03]),
    ("left_knee", Some(1), [0.03, -0.38, 0.0]),
    ("right_knee", Some(2), [-0.03, -0.38, 0.0]),
    ("spine2", Some(3), [0.0, 0.14, 0.0]),
    ("left_ankle", Some(4), [-0.01, -0.40, -0.04]),
    ("right_ankle", Some(5), [0.01, -0.40, -0.04]),
    ("spine3", Some(6), [0.0, 0.05, 0.03]),
    ("left_foot", Some(7), [0.03, -0.06, 0.12]),
    ("right_foot", Some(8), [-0.03, -0.06, 0.12]),
    ("neck", Some(9), [0.0, 0.21, -0.04]),
    ("left_collar", Some(9), [0.08, 0.12, -0.03]),
    ("right_collar", Some(9), [-0.08, 0.12, -0.03]),
    ("head", Some(12), [0.0, 0.07, 0.05]),
    ("left_shoulder", Some(13), [0.09, 0.03, -0.01]),
    ("right_shoulder", Some(14), [-0.09, 0.03, -0.01]),
    ("left_elbow", Some(16), [0.26, -0.01, -0.03]),
    ("right_elbow", Some(17), [-0.26, -0.01, -0.03]),
    ("left_wrist", Some(18), [0.25, 0.01, 0.0]),
    ("right_wrist", Some(19), [-0.25, 0.01, 0.0]),
];

/// Names of the arrays that hold the rotations: in one, or the pelvis apart from the others.
const WHOLE: &str = "poses.npy";
const PARTS: [&str; 2] = ["root_orient.npy", "pose_body.npy"];
/// Names of the array with the frame rate (Hz) and with the path of the body.
const RATES: [&str; 3] = [
    "mocap_framerate.npy",
    "mocap_frame_rate.npy",
    "mocap_fps.npy",
];
const PATH: &str = "trans.npy";
/// Smallest mean share of the pelvis' upward axis along an axis of the file for that to be the vertical.
const UPRIGHT: f64 = 0.5;

/// Whether an archive holds such a motion.
pub(crate) fn is_motion(archive: &Archive<'_>) -> bool {
    let has = |name: &str| archive.names().any(|own| own == name);
    has(WHOLE) || PARTS.iter().all(|name| has(name))
}

/// Reads a motion, with the mapping of its joints and warnings.
///
/// # Errors
/// Returns an error if an array is absent, damaged or has another shape.
pub(crate) fn read(archive: &Archive<'_>) -> Result<(Tree, Mapping, Vec<String>)> {
    let poses = match rows(archive, WHOLE, 3 * JOINTS.len())? {
        Some(poses) => poses,
        None => {
            let parts = [rows(archive, PARTS[0], 3)?, rows(archive, PARTS[1], 63)?];
            let [Some(root), Some(body)] = parts else {
                return Err(absent(WHOLE));
            };
            (root.iter().zip(&body))
                .map(|(root, body)| [&root[..], &body[..]].concat())
                .collect()
        }
    };
    let path = rows(archive, PATH, 3)?.ok_or_else(|| absent(PATH))?;
    if path.len() != poses.len() || poses.len() < 2 {
        let message = format!(
            "expected at least 2 frames, as many in {PATH} as poses, found {} and {}",
            path.len(),
            poses.len()
        );
        return Err(Problem::bad_input(message));
    }
    let rate = RATES
        .iter()
        .find_map(|name| array(archive, name).transpose());
    let rate = rate
        .transpose()?
        .and_then(|rate| rate.values.first().copied());
    let rate = rate
        .filter(|rate| rate.is_finite() && *rate > 0.0)
        .ok_or_else(|| {
            Problem::bad_input(format!(
                "expected a frame rate in {}, found none",
                RATES.join(" or ")
            ))
        })?;
    let mut values = Vec::with_capacity(poses.len() * 3 * (JOINTS.len() + 1));
    for (frame, (place, pose)) in path.iter().zip(&poses).enumerate() {
        if !place.iter().chain(pose).all(|value| value.is_finite()) {
            let message = "expected finite numbers only";
            return Err(Problem::bad_input(message).at(format!("frame {frame}")));
        }
        values.extend(place.iter().chain(pose));
    }
    let (axes, mut warnings) = world(&poses);
    let joints = JOINTS
        .iter()
        .map(|(name, parent, offset)| ((*name).to_owned(), *parent, Vector3::from(*offset)));
    let tree = Tree::of_vectors(joints.collect(), rate, values);
    let mut mapping = names::mapping(&tree).ok_or_else(|| absent(WHOLE))?;
    mapping.world.axes = axes;
    mapping.world.unit_m = Some(1.0);
    warnings.push("the file has no lengths of bones: the hips are taken as in the mean adult, 0.09 m below the pelvis joint".to_owned());
    Ok((tree, mapping, warnings))
}

fn absent(name: &str) -> Problem {
    Problem::bad_input(format!("expected an array {name}, found none")).help(
        "a motion of SMPL has poses, trans and mocap_framerate, as AMASS distributes it; files of body shapes have none",
    )
}

fn array(archive: &Archive<'_>, name: &str) -> Result<Option<Array>> {
    let bytes = archive.member(name)?;
    let array = bytes.map(|bytes| Array::parse(&bytes)).transpose();
    array.map_err(|problem| problem.at(name.to_owned()))
}

/// The first `width` numbers of each row.
fn rows(archive: &Archive<'_>, name: &str, width: usize) -> Result<Option<Vec<Vec<f64>>>> {
    let Some(array) = array(archive, name)? else {
        return Ok(None);
    };
    match array.shape[..] {
        [_, columns] if columns >= width && columns % 3 == 0 => Ok(Some(
            (array.values.chunks_exact(columns))
                .map(|row| row[..width].to_vec())
                .collect(),
        )),
        _ => {
            let message = format!(
                "expected rows of {width} numbers or more, three for each joint, found a shape of {:?}",
                array.shape
            );
            Err(Problem::bad_input(message).at(name.to_owned()))
        }
    }
}

/// The axes of the file: AMASS has Z up, other programs Y. The pelvis of people is mostly upright.
fn world(poses: &[Vec<f64>]) -> (WorldAxes, Vec<String>) {
    let up = poses.iter().map(|pose| {
        let turned = UnitQuaternion::from_scaled_axis(Vector3::new(pose[0], pose[1], pose[2]));
        turned * Vector3::y()
    });
    let mean = up.sum::<Vector3<f64>>() / poses.len().max(1) as f64;
    let y_up = mean.y > mean.z.max(UPRIGHT);
    let mut warnings = Vec::new();
    if y_up {
        warnings.push(
            "the person stands along the file's Y: that is taken as up, not Z as in AMASS"
                .to_owned(),
        );
    } else if mean.z < UPRIGHT {
        warnings.push(
            "the person is not upright for most of the time: Z is taken as up, as in AMASS"
                .to_owned(),
        );
    }
    let names = if y_up {
        ["west", "up", "north"]
    } else {
        ["east", "north", "up"]
    };
    // The names are three directions at right angles.
    let axes = WorldAxes::try_from(names.map(str::to_owned));
    (
        axes.unwrap_or(WorldAxes(nalgebra::Matrix3::identity())),
        warnings,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::archive::tests::packed;
    use crate::numpy::tests::written;

    /// Two frames upright in a world with Z up, the left knee bent in the second.
    fn poses(joints: usize) -> Vec<f64> {
        let mut pose = vec![0.0; 3 * joints];
        pose[0] = core::f64::consts::FRAC_PI_2;
        let mut bent = pose.clone();
        bent[12] = 1.0;
        [pose, bent].concat()
    }

    fn file(joints: usize, leave_out: &str) -> Vec<u8> {
        let members = [
            (
                WHOLE,
                written(&format!("2, {}", 3 * joints), &poses(joints)),
            ),
            (PATH, written("2, 3", &[0.0, 0.0, 1.0, 0.0, 0.0, 1.1])),
            (RATES[0], written("", &[120.0])),
        ];
        let kept: Vec<(&str, &[u8])> = members
            .iter()
            .filter(|(name, _)| *name != leave_out)
            .map(|(name, bytes)| (*name, &bytes[..]))
            .collect();
        packed(&kept)
    }

    fn read(bytes: &[u8]) -> Result<(Tree, Mapping, Vec<String>)> {
        super::read(&Archive::read(bytes)?)
    }

    #[test]
    fn all_models_of_the_family_are_read() {
        for joints in [22, 24, 52, 55] {
            let (tree, mapping, warnings) = read(&file(joints, "")).unwrap();
            assert_eq!((tree.frames(), tree.joints.len()), (2, 22));
            assert!((tree.rate - 120.0).abs() < 1e-12);
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            let joint = |segment: &str| mapping.segments[segment].joint.clone().unwrap();
            assert_eq!(joint("l_shank"), "left_knee");
            assert_eq!(joint("thorax"), "spine3");
            assert_eq!(joint("r_hand"), "right_wrist");
            // The knee bends about X, which is left: the shank swings forwards or back, here to -Y of the world.
            let placed = tree.placed(1);
            let shank = placed[7].position - placed[4].position;
            assert!(shank.y.abs() > 0.3 && shank.x.abs() < 0.02, "{shank}");
        }
    }

    #[test]
    fn absent_and_damaged_arrays_are_refused_by_name() {
        for (bytes, part) in [
            (file(22, WHOLE), WHOLE),
            (file(22, PATH), PATH),
            (file(22, RATES[0]), "frame rate"),
            (file(20, ""), "a shape of [2, 60]"),
        ] {
            let said = read(&bytes).unwrap_err().to_string();
            assert!(said.contains(part), "{said}");
        }
    }
}
