//! Support for the end-to-end tests: location of the shared data, and the reference numbers as core types.

pub mod arm_swing;
pub mod estimator_flights;
pub mod fuzz_targets;
pub mod greeting;
pub mod long_recording;
pub mod program;
pub mod range_watch;
pub mod receiver;
pub mod slimevr_jump;
pub mod slimevr_trackers;
pub mod small_recording;
pub mod text_inputs;
pub mod transitions;

use std::path::PathBuf;

use bodyflight_core::body::posture::joint_rotation;
use bodyflight_core::{Body, Posture, Real, Segment, SegmentArray, SegmentParameters};
use bodyflight_shared_data::shared;
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;

/// The column of a segment in a table of OpenSense's orientations.
pub fn opensense_name(segment: &str) -> String {
    let bones = [
        ("upperarm", "humerus"),
        ("forearm", "ulna"),
        ("hand", "hand"),
        ("thigh", "femur"),
        ("shank", "tibia"),
        ("foot", "calcn"),
    ];
    let limb = segment.split_once('_').and_then(|(side, limb)| {
        let (_, bone) = bones.iter().find(|(own, _)| *own == limb)?;
        Some(format!("{bone}_{side}_imu"))
    });
    let trunk = || {
        segment
            .replace("thorax", "torso")
            .replace("abdomen", "spine")
            + "_imu"
    };
    limb.unwrap_or_else(trunk)
}

/// The folder of reference numbers; `None`, with a notice, if it is absent.
pub fn reference_folder() -> Option<PathBuf> {
    shared("reference")
}

/// The folder of public recordings; `None`, with a notice, if it is absent.
pub fn data_folder() -> Option<PathBuf> {
    shared("data")
}

/// Parses a reference file; `None` if the folder is absent. Panics if the file is not readable.
pub fn reference(name: &str) -> Option<Value> {
    let path = reference_folder()?.join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Some(serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

/// The numbers of an array, however deeply nested.
pub fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(numbers).collect(),
        other => other.as_f64().into_iter().collect(),
    }
}

/// Three numbers as a vector.
pub fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_row_slice(&numbers(value))
}

/// Nine numbers as a matrix, row by row.
pub fn matrix(value: &Value) -> Matrix3<f64> {
    Matrix3::from_row_slice(&numbers(value))
}

/// Four numbers w, x, y, z as a rotation.
pub fn quaternion(value: &Value) -> UnitQuaternion<f64> {
    let q = numbers(value);
    UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3]))
}

/// The body of `segments.json`, with moment arms equal to the lengths.
pub fn reference_body(table: &Value) -> Body<f64> {
    let find = |segment: Segment| {
        let rows = table["segments"]
            .as_array()
            .map(Vec::as_slice)
            .unwrap_or_default();
        rows.iter()
            .find(|row| row["name"] == segment.name())
            .unwrap_or(&Value::Null)
    };
    Body {
        segments: SegmentArray::from_fn(|segment| {
            let row = find(segment);
            let number = |key: &str| row[key].as_f64().unwrap_or(f64::NAN);
            SegmentParameters {
                mass: number("mass"),
                length: number("length"),
                joint_offset: vector(&row["joint_offset"]),
                cg: vector(&row["cg"]),
                inertia: matrix(&row["inertia"]),
                area: vector(&row["area"]),
                moment_arm: number("length"),
            }
        }),
        height: table["height"].as_f64().unwrap_or(f64::NAN),
    }
}

/// A posture from the paper's angles by segment name.
pub fn posture_of_angles(angles: &Value) -> Posture<f64> {
    Segment::ALL
        .into_iter()
        .fold(Posture::h_pose(), |posture, segment| {
            match numbers(&angles[segment.name()])[..] {
                [psi, theta, phi] => posture.with(segment, joint_rotation(psi, theta, phi)),
                _ => posture,
            }
        })
}

/// Asserts that `actual` equals `expected` within `tolerance` times the larger of `scale` and the norm of `expected`.
#[track_caller]
pub fn assert_close<T: Real, const R: usize, const C: usize>(
    actual: &nalgebra::SMatrix<T, R, C>,
    expected: &nalgebra::SMatrix<f64, R, C>,
    scale: f64,
    tolerance: f64,
    what: &str,
) {
    let difference = (actual.map(Real::to_f64) - expected).norm();
    let limit = tolerance * expected.norm().max(scale);
    assert!(
        difference <= limit,
        "{what}: {actual:?}, expected {expected:?}: off by {difference:e}"
    );
}
