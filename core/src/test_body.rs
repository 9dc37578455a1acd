//! A body and postures for the unit tests of this crate: the reference table of a 1.75 m, 75 kg person.

use nalgebra::{Matrix3, Vector3};
use proptest::prelude::*;

use crate::Posture;
use crate::body::{Body, Segment, SegmentArray, SegmentParameters};

/// mass, length, joint offset, cg, principal inertia, areas (SI, segment axes).
type Row = (f64, f64, [f64; 3], [f64; 3], [f64; 3], [f64; 3]);

const TRUNK_AND_LEFT: [Row; 10] = [
    (
        8.3775,
        0.15,
        [0.0, 0.0, 0.0],
        [0.0, 0.0, 0.075],
        [0.04104975, 0.07623525, 0.085869375],
        [0.033, 0.051, 0.0587477826],
    ),
    (
        12.2475,
        0.2,
        [0.0, 0.0, 0.15],
        [0.0, 0.0, 0.1],
        [0.07144375, 0.109717187, 0.0995109375],
        [0.04, 0.06, 0.0471238898],
    ),
    (
        11.97,
        0.25,
        [0.0, 0.0, 0.2],
        [0.0, 0.0, 0.125],
        [0.098553, 0.143814562, 0.117680062],
        [0.055, 0.0825, 0.0570199067],
    ),
    (
        5.205,
        0.26,
        [0.0, 0.0, 0.28],
        [0.0, 0.0, 0.13],
        [0.0280029, 0.025114125, 0.017931225],
        [0.0408407045, 0.0347145988, 0.0267035376],
    ),
    (
        2.0325,
        0.29,
        [0.19, 0.0, 0.21],
        [0.0, 0.0, -0.134303279],
        [0.0151086588, 0.0151086588, 0.00210013893],
        [0.0261, 0.0261, 0.00785398163],
    ),
    (
        1.215,
        0.26,
        [0.0, 0.0, -0.29],
        [0.0, 0.0, -0.114132007],
        [0.00696608235, 0.00696608235, 0.000731245168],
        [0.01755, 0.01755, 0.00502654825],
    ),
    (
        0.4575,
        0.18,
        [0.0, 0.0, -0.26],
        [0.0, 0.0, -0.09],
        [0.0007617375, 0.0009264375, 0.000205875],
        [0.00424115008, 0.0127234502, 0.00212057504],
    ),
    (
        10.62,
        0.43,
        [0.09, 0.0, -0.02],
        [0.0, 0.0, -0.190529827],
        [0.173204276, 0.173204276, 0.0292848167],
        [0.06235, 0.06235, 0.0226980069],
    ),
    (
        3.2475,
        0.42,
        [0.0, 0.0, -0.43],
        [0.0, 0.0, -0.182368421],
        [0.0479251617, 0.0479251617, 0.00432772105],
        [0.042, 0.042, 0.0113097336],
    ),
    (
        1.0275,
        0.27,
        [0.0, 0.0, -0.42],
        [0.0, -0.075, -0.04],
        [0.0066530625, 0.0010531875, 0.00688425],
        [0.0216, 0.00628318531, 0.027],
    ),
];

/// The body of the reference numbers, with moment arms equal to the lengths.
pub(crate) fn reference_body() -> Body<f64> {
    let row = |segment: Segment| {
        use Segment as S;
        let (index, side) = match segment {
            S::Pelvis => (0, 1.0),
            S::Abdomen => (1, 1.0),
            S::Thorax => (2, 1.0),
            S::Head => (3, 1.0),
            S::LeftUpperArm => (4, 1.0),
            S::LeftForearm => (5, 1.0),
            S::LeftHand => (6, 1.0),
            S::LeftThigh => (7, 1.0),
            S::LeftShank => (8, 1.0),
            S::LeftFoot => (9, 1.0),
            S::RightUpperArm => (4, -1.0),
            S::RightForearm => (5, -1.0),
            S::RightHand => (6, -1.0),
            S::RightThigh => (7, -1.0),
            S::RightShank => (8, -1.0),
            S::RightFoot => (9, -1.0),
        };
        let (mass, length, offset, cg, inertia, area) = TRUNK_AND_LEFT[index];
        SegmentParameters {
            mass,
            length,
            joint_offset: Vector3::new(offset[0] * side, offset[1], offset[2]),
            cg: Vector3::from(cg),
            inertia: Matrix3::from_diagonal(&Vector3::from(inertia)),
            area: Vector3::from(area),
            moment_arm: length,
        }
    };
    Body {
        segments: SegmentArray::from_fn(row),
        height: 1.75,
    }
}

/// Any posture with joint rotations up to 1.5 rad about each axis.
pub(crate) fn any_posture() -> impl Strategy<Value = Posture<f64>> {
    prop::collection::vec(-1.5f64..1.5, 48).prop_map(|angles| {
        Segment::ALL
            .into_iter()
            .zip(angles.chunks(3))
            .fold(Posture::h_pose(), |posture, (segment, a)| {
                posture.with_angles(segment, a[0], a[1], a[2])
            })
    })
}
