//! The known flight as ASF and AMC.

use std::fmt::Write;

use bodyflight_core::Segment;
use bodyflight_core::body::posture::pose;
use bodyflight_mvnx::xsens;
use bodyflight_replay::subject::Subject;
use bodyflight_tests::program::{plain, written};
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::bvh::bvh_axes;
use crate::known::{PROGRAM, RETURNS, frames, known, turned};
use crate::systems::from_rest;

/// A row of the table of bones.
type Bone = (
    &'static str,
    &'static str,
    Option<Segment>,
    Option<[Segment; 2]>,
);

/// Bones of the CMU library: name, parent, the segment that they turn with, and the segments between whose joints they
/// lie. Bones without a length and a freedom only connect.
const BONES: [Bone; 18] = {
    use Segment::*;
    [
        ("lhipjoint", "root", None, Some([Pelvis, LeftThigh])),
        (
            "lfemur",
            "lhipjoint",
            Some(LeftThigh),
            Some([LeftThigh, LeftShank]),
        ),
        (
            "ltibia",
            "lfemur",
            Some(LeftShank),
            Some([LeftShank, LeftFoot]),
        ),
        ("lfoot", "ltibia", Some(LeftFoot), None),
        ("rhipjoint", "root", None, Some([Pelvis, RightThigh])),
        (
            "rfemur",
            "rhipjoint",
            Some(RightThigh),
            Some([RightThigh, RightShank]),
        ),
        (
            "rtibia",
            "rfemur",
            Some(RightShank),
            Some([RightShank, RightFoot]),
        ),
        ("rfoot", "rtibia", Some(RightFoot), None),
        ("lowerback", "root", Some(Abdomen), Some([Pelvis, Thorax])),
        ("thorax", "lowerback", Some(Thorax), None),
        ("head", "thorax", Some(Head), None),
        ("lclavicle", "thorax", None, Some([Thorax, LeftUpperArm])),
        (
            "lhumerus",
            "lclavicle",
            Some(LeftUpperArm),
            Some([LeftUpperArm, LeftForearm]),
        ),
        (
            "lradius",
            "lhumerus",
            Some(LeftForearm),
            Some([LeftForearm, LeftHand]),
        ),
        ("lhand", "lradius", Some(LeftHand), None),
        ("rclavicle", "thorax", None, Some([Thorax, RightUpperArm])),
        (
            "rhumerus",
            "rclavicle",
            Some(RightUpperArm),
            Some([RightUpperArm, RightForearm]),
        ),
        (
            "rradius",
            "rhumerus",
            Some(RightForearm),
            Some([RightForearm, RightHand]),
        ),
    ]
};

/// Angles about fixed X, Y, Z (degrees).
fn angles(m: &Matrix3<f64>) -> [f64; 3] {
    let y = (-m[(2, 0)]).clamp(-1.0, 1.0).asin();
    let (x, z) = (m[(2, 1)].atan2(m[(2, 2)]), m[(1, 0)].atan2(m[(0, 0)]));
    [x, y, z].map(f64::to_degrees)
}

/// The known flight as ASF and AMC, in units of the CMU library, with axes of bones turned anyhow.
fn acclaim() -> (String, String) {
    let [body_axes, world_axes] = bvh_axes();
    let unit = 0.0254 / 0.45;
    let rest = xsens::t_pose();
    let at_rest = pose(&Subject::default().body(), &rest);
    let rest = rest.body_from_segments();
    let mut asf = ":version 1.10\n:name VICON\n:units\n  mass 1.0\n  length 0.45\n  angle deg\n:root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n\
        \u{20} position 0 0 0\n  orientation 0 0 0\n:bonedata\n"
        .to_owned();
    let axis = |k: usize| [k as f64 * 5.0, 10.0, -20.0 + k as f64];
    for (k, (name, _, segment, ends)) in BONES.iter().enumerate() {
        let way = ends.map_or_else(Vector3::y, |[from, to]| {
            body_axes.transpose() * (at_rest[to].joint - at_rest[from].joint)
        });
        let length = if ends.is_some() {
            way.norm() / unit
        } else {
            1.0
        };
        let way = way.normalize();
        let [a, b, c] = axis(k);
        let _ = write!(
            asf,
            "  begin\n    id {}\n    name {name}\n    direction {} {} {}\n    length {length}\n    axis {a} {b} {c} XYZ\n",
            k + 1,
            way.x,
            way.y,
            way.z
        );
        let dof = if segment.is_some() {
            "    dof rx ry rz\n    limits (-180 180)\n           (-180 180)\n           (-180 180)\n"
        } else {
            ""
        };
        let _ = writeln!(asf, "{dof}  end");
    }
    asf.push_str(":hierarchy\n  begin\n");
    for (name, parent, ..) in BONES {
        let _ = writeln!(asf, "    {parent} {name}");
    }
    asf.push_str("  end\n");
    let mut amc =
        "#!OML:ASF C:\\01.ASF\n:FULLY-SPECIFIED\n:DEGREES\n:SAMPLES-PER-SECOND 200\n".to_owned();
    for (k, frame) in known().iter().enumerate() {
        let moved = from_rest(&turned(frame), &rest);
        let place = world_axes.transpose() * frame.pelvis.position.components / unit;
        let [a, b, c] = angles(&moved[Segment::Pelvis]);
        let _ = writeln!(
            amc,
            "{}\nroot {} {} {} {a} {b} {c}",
            k + 1,
            place.x,
            place.y,
            place.z
        );
        let of = |name: &str| {
            let mut bone = name;
            loop {
                let Some((_, parent, segment, _)) = BONES.iter().find(|(own, ..)| *own == bone)
                else {
                    return moved[Segment::Pelvis];
                };
                match segment {
                    Some(segment) => return moved[*segment],
                    None => bone = parent,
                }
            }
        };
        for (k, (name, parent, segment, _)) in BONES.iter().enumerate() {
            if segment.is_none() {
                continue;
            }
            let [a, b, c] = axis(k).map(f64::to_radians);
            let own = Rotation3::new(Vector3::z() * c)
                * Rotation3::new(Vector3::y() * b)
                * Rotation3::new(Vector3::x() * a);
            let relative = of(parent).transpose() * of(name);
            let [a, b, c] = angles(&(own.matrix().transpose() * relative * own.matrix()));
            let _ = writeln!(amc, "{name} {a} {b} {c}");
        }
    }
    (asf, amc)
}

#[test]
fn a_flight_survives_asf_and_amc() {
    let folder = tempfile::tempdir().expect("a folder");
    let (asf, amc) = acclaim();
    let file = written(folder.path(), "01_01.amc", &amc);
    let out = plain(&folder.path().join("out")).to_owned();
    let said = PROGRAM.fails(&["import", &file, "--out", &out], 2);
    assert!(
        said.contains("01_01.asf or 01.asf") && said.contains("no .asf file"),
        "{said}"
    );
    written(folder.path(), "01.asf", &asf);
    written(folder.path(), "02.asf", "not this one");
    // The right hand has no bone here, and follows its forearm.
    let report = PROGRAM.json(&["import", &file, "--out", &out, "--force"]);
    assert_eq!(report["frame_rate_hz"], 200.0);
    let (came, went) = (frames(&folder.path().join("out/flight.mvnx")), known());
    for (came, went) in came.iter().zip(&went) {
        let (a, b) = (turned(came), turned(went));
        for segment in Segment::ALL
            .into_iter()
            .filter(|segment| *segment != Segment::RightHand)
        {
            let angle = a[segment].angle_to(&b[segment]).to_degrees();
            assert!(angle < RETURNS, "{segment:?}: {angle}");
        }
        let apart = came.pelvis.position.components - went.pelvis.position.components;
        assert!(apart.norm() < 1e-3, "{apart}");
    }
    let (report, _) = PROGRAM.answer(&["airborne", &file]);
    assert_eq!(
        report["phases"].as_array().map(Vec::len),
        Some(1),
        "{report}"
    );
    let missing = amc.replacen("\nlradius", "\n#lradius", 1);
    let file = written(folder.path(), "01_02.amc", &missing);
    let said = PROGRAM.fails(&["import", &file, "--out", &out, "--force"], 2);
    assert!(
        said.contains("01_02.amc:") && said.contains("frame 1 lacks lradius"),
        "{said}"
    );
}
