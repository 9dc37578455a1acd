//! The known flight as files of systems that need no mapping, or a short one.

use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mvnx::xsens::{self, MvnSegment};
use bodyflight_tests::program::plain;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use crate::bvh::bvh_axes;
use crate::known::{PROGRAM, RETURNS, imported, known, largest, turned};

/// Checks that a file gives the known flight without a mapping, and that `airborne` and `inspect` accept it.
fn returns(folder: &Path, file: &str, most_m: f64) {
    let (angles, places) = imported(folder, &[file]);
    assert!(largest(&angles) < RETURNS, "{file}: {angles:?}");
    assert!(places < most_m, "{file}: {places} m");
    let (report, code) = PROGRAM.answer(&["airborne", file]);
    assert_eq!(
        report["phases"].as_array().map(Vec::len),
        Some(1),
        "{report}"
    );
    // The model of a default person may not fit; the file itself is accepted.
    assert!([Some(0), Some(4)].contains(&code), "{report}");
    let flight = folder.join("out/flight.mvnx");
    let (report, code) = PROGRAM.answer(&["inspect", plain(&flight)]);
    assert_ne!(code, Some(2), "{report}");
}

/// An archive of stored members.
fn packed(path: &Path, members: &[(String, Vec<u8>)]) {
    let four = |value: usize| u32::try_from(value).expect("small").to_le_bytes();
    let two = |value: usize| u16::try_from(value).expect("small").to_le_bytes();
    let (mut bytes, mut list) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let mut sum = flate2::Crc::new();
        sum.update(content);
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        common.extend(sum.sum().to_le_bytes());
        common.extend([four(content.len()), four(content.len())].concat());
        common.extend([two(name.len()), two(0)].concat());
        list.extend(
            [
                b"PK\x01\x02\x14\0",
                &common[..],
                &[0; 10],
                &four(bytes.len()),
                name.as_bytes(),
            ]
            .concat(),
        );
        bytes.extend([b"PK\x03\x04", &common[..], name.as_bytes(), content].concat());
    }
    let count = two(members.len());
    let end = [
        b"PK\x05\x06\0\0\0\0",
        &count[..],
        &count,
        &four(list.len()),
        &four(bytes.len()),
        &[0, 0],
    ]
    .concat();
    bytes.extend([list, end].concat());
    std::fs::write(path, bytes).expect("written");
}

/// The rotation of each segment from the rest posture, in the axes of most programs (X left, Y up, Z forward).
pub(crate) fn from_rest(
    frame: &SegmentArray<UnitQuaternion<f64>>,
    rest: &SegmentArray<UnitQuaternion<f64>>,
) -> SegmentArray<Matrix3<f64>> {
    let [body_axes, world_axes] = bvh_axes();
    frame.map(|segment, turned| {
        let body_from_joint = body_axes.transpose() * rest[segment].to_rotation_matrix().matrix();
        world_axes.transpose() * turned.to_rotation_matrix().matrix() * body_from_joint.transpose()
    })
}

/// Directions of the limbs of SMPL's rest posture (X left, Y up, Z forward), of the left side.
const LIMBS: [(Segment, Segment, [f64; 3]); 4] = [
    (
        Segment::LeftUpperArm,
        Segment::RightUpperArm,
        [0.26, -0.01, -0.03],
    ),
    (
        Segment::LeftForearm,
        Segment::RightForearm,
        [0.25, 0.01, 0.0],
    ),
    (Segment::LeftThigh, Segment::RightThigh, [0.03, -0.38, 0.0]),
    (
        Segment::LeftShank,
        Segment::RightShank,
        [-0.01, -0.40, -0.04],
    ),
];

/// The T-pose with limbs along those of SMPL; hands follow their forearms.
fn smpl_rest() -> SegmentArray<UnitQuaternion<f64>> {
    let [body_axes, _] = bvh_axes();
    let mut rest = xsens::t_pose().body_from_segments();
    let mut bend = |segment: Segment, way: Vector3<f64>| {
        let now = rest[segment] * -Vector3::z();
        let turn =
            UnitQuaternion::rotation_between(&now, &(body_axes * way)).expect("not opposite");
        rest[segment] = turn * rest[segment];
    };
    for (left, right, [x, y, z]) in LIMBS {
        bend(left, Vector3::new(x, y, z));
        bend(right, Vector3::new(-x, y, z));
    }
    bend(Segment::LeftHand, Vector3::new(0.25, 0.01, 0.0));
    bend(Segment::RightHand, Vector3::new(-0.25, 0.01, 0.0));
    rest
}

/// An array as NumPy writes it.
fn array(shape: &str, values: &[f64]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}");
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    let _ = writeln!(bytes, "{header:<117}");
    #[expect(clippy::cast_possible_truncation, reason = "the file's precision")]
    bytes.extend(
        values
            .iter()
            .flat_map(|value| (*value as f32).to_le_bytes()),
    );
    bytes
}

#[test]
fn a_flight_survives_amass() {
    let folder = tempfile::tempdir().expect("a folder");
    // Segment of each joint, in the order of SMPL-H; joints without one do not turn.
    let joints: [(usize, Option<usize>, Segment); 16] = [
        (0, None, Segment::Pelvis),
        (1, Some(0), Segment::LeftThigh),
        (2, Some(0), Segment::RightThigh),
        (3, Some(0), Segment::Abdomen),
        (4, Some(1), Segment::LeftShank),
        (5, Some(2), Segment::RightShank),
        (7, Some(4), Segment::LeftFoot),
        (8, Some(5), Segment::RightFoot),
        (9, Some(3), Segment::Thorax),
        (15, Some(9), Segment::Head),
        (16, Some(9), Segment::LeftUpperArm),
        (17, Some(9), Segment::RightUpperArm),
        (18, Some(16), Segment::LeftForearm),
        (19, Some(17), Segment::RightForearm),
        (20, Some(18), Segment::LeftHand),
        (21, Some(19), Segment::RightHand),
    ];
    let rest = smpl_rest();
    let (mut poses, mut path) = (Vec::new(), Vec::new());
    // From the axes of most programs to those of AMASS: X east, Y north, Z up.
    let z_up = Matrix3::from_columns(&[-Vector3::x(), Vector3::z(), Vector3::y()]);
    for frame in known() {
        let moved = from_rest(&turned(&frame), &rest).map(|_, turned| z_up * turned);
        let mut pose = [0.0; 156];
        for (joint, parent, segment) in joints {
            let above = joints.iter().find(|(other, ..)| Some(*other) == parent);
            let above = above.map_or_else(Matrix3::identity, |(_, _, segment)| moved[*segment]);
            let relative = Rotation3::from_matrix_unchecked(above.transpose() * moved[segment]);
            let vector = UnitQuaternion::from_rotation_matrix(&relative).scaled_axis();
            pose[3 * joint..3 * joint + 3].copy_from_slice(vector.as_slice());
        }
        poses.extend(pose);
        let north_west_up = frame.pelvis.position.components;
        let place = Vector3::new(-north_west_up.y, north_west_up.x, north_west_up.z);
        let place = place - moved[Segment::Pelvis] * Vector3::new(0.0, -0.09, -0.01);
        path.extend(place.iter());
    }
    let count = known().len();
    let file = folder.path().join("jump_poses.npz");
    let members = [
        (
            "poses.npy".to_owned(),
            array(&format!("{count}, 156"), &poses),
        ),
        ("trans.npy".to_owned(), array(&format!("{count}, 3"), &path)),
        ("mocap_framerate.npy".to_owned(), array("", &[200.0])),
        ("gender.npy".to_owned(), b"not a number".to_vec()),
    ];
    packed(&file, &members);
    returns(folder.path(), plain(&file), 2e-3);
    let mut damaged = std::fs::read(&file).expect("the file");
    damaged[5000] ^= 1;
    std::fs::write(&file, damaged).expect("written");
    let out = plain(&folder.path().join("new")).to_owned();
    let said = PROGRAM.fails(&["import", plain(&file), "--out", &out], 2);
    assert!(
        said.contains("poses.npy") && said.contains("checksum"),
        "{said}"
    );
}

#[test]
fn a_flight_survives_movellas_workbooks() {
    let folder = tempfile::tempdir().expect("a folder");
    let spaced = |label: &str| {
        let spaced = label
            .replace("Upper", " Upper ")
            .replace("Lower", " Lower ")
            .replace("ForeArm", " Forearm");
        spaced
            .replace("Shoulder", " Shoulder")
            .replace("Hand", " Hand")
            .replace("Foot", " Foot")
            .replace("Toe", " Toe")
    };
    let row = |cells: &[String], number: usize| {
        let cells = cells.iter().map(|cell| match cell.parse::<f64>() {
            Ok(_) => format!("<c><v>{cell}</v></c>"),
            Err(_) => format!("<c t=\"inlineStr\"><is><t>{cell}</t></is></c>"),
        });
        format!("<row r=\"{number}\">{}</row>", cells.collect::<String>())
    };
    let names = MvnSegment::ALL.map(|mvn| spaced(mvn.label()));
    let head = |parts: &[&str]| {
        let names = names
            .iter()
            .flat_map(|name| parts.iter().map(move |part| format!("{name} {part}")));
        core::iter::once("Frame".to_owned())
            .chain(names)
            .collect::<Vec<_>>()
    };
    let mut turns = row(&head(&["q0", "q1", "q2", "q3"]), 1);
    let mut places = row(&head(&["x", "y", "z"]), 1);
    for (k, frame) in known().iter().enumerate() {
        let all = xsens::mvn_orientations(frame.pelvis.inertial_from_body, &frame.posture);
        let mut cells = [vec![k.to_string()], vec![k.to_string()]];
        for mvn in MvnSegment::ALL {
            let q = all[mvn.part_of()].quaternion();
            cells[0].extend([q.w, q.i, q.j, q.k].map(|part| format!("{part:.6}")));
            let place = frame.pelvis.position.components;
            cells[1].extend([place.x, place.y, place.z].map(|part| format!("{part:.6}")));
        }
        turns.push_str(&row(&cells[0], k + 2));
        places.push_str(&row(&cells[1], k + 2));
    }
    let general = row(&["Frame Rate".to_owned(), "200".to_owned()], 1);
    let sheets = [
        ("General Information", general),
        ("Segment Orientation - Quat", turns),
        ("Segment Position", places),
    ];
    let (mut list, mut relations) = (String::new(), String::new());
    let mut members = Vec::new();
    for (k, (name, rows)) in sheets.iter().enumerate() {
        let _ = write!(
            list,
            "<sheet name=\"{name}\" sheetId=\"{k}\" r:id=\"rId{k}\"/>"
        );
        let _ = write!(
            relations,
            "<Relationship Id=\"rId{k}\" Target=\"worksheets/sheet{k}.xml\"/>"
        );
        let sheet = format!("<worksheet><sheetData>{rows}</sheetData></worksheet>");
        members.push((format!("xl/worksheets/sheet{k}.xml"), sheet.into_bytes()));
    }
    let list = format!("<workbook><sheets>{list}</sheets></workbook>");
    let relations = format!("<Relationships>{relations}</Relationships>");
    members.push(("xl/workbook.xml".to_owned(), list.into_bytes()));
    members.push((
        "xl/_rels/workbook.xml.rels".to_owned(),
        relations.into_bytes(),
    ));
    let file = folder.path().join("jump.xlsx");
    packed(&file, &members);
    returns(folder.path(), plain(&file), 1e-3);
}

#[test]
fn formats_without_a_reader_say_what_to_export() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = plain(&folder.path().join("out")).to_owned();
    for (name, bytes) in [
        ("jump.fbx", &b"Kaydara FBX Binary  \x00\x1a\x00\xff\xff"[..]),
        ("jump.glb", b"glTF\x02\x00\x00\x00"),
    ] {
        let file = folder.path().join(name);
        std::fs::File::create(&file)
            .and_then(|mut file| file.write_all(bytes))
            .expect("written");
        for words in [
            &["import", plain(&file), "--out", &out][..],
            &["airborne", plain(&file)],
        ] {
            let said = PROGRAM.fails(words, 2);
            assert!(
                said.contains("not supported") && said.contains("export BVH"),
                "{said}"
            );
        }
    }
}
