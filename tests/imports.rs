//! Import by the real binary: a known flight, written in each format, is recovered.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "imports/acclaim.rs"]
mod acclaim;
#[path = "imports/bvh.rs"]
mod bvh;
#[path = "imports/c3d.rs"]
mod c3d;
#[path = "imports/doubts.rs"]
mod doubts;
#[path = "imports/known.rs"]
mod known;
#[path = "imports/markers.rs"]
mod markers;
#[path = "imports/sensors.rs"]
mod sensors;
#[path = "imports/slips.rs"]
mod slips;
#[path = "imports/systems.rs"]
mod systems;

use std::fmt::Write;

use bodyflight_core::{Segment, SegmentArray};
use bodyflight_mvnx::recording::FlightFrame;
use bodyflight_mvnx::xsens;
use bodyflight_tests::program::{plain, text, written};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use known::{PROGRAM, RETURNS, acrobatics, imported, known, largest, turned};
use markers::{nexus, points, points_mapping, trc};

/// CSV rows with the quaternions of all segments that `of` returns for each frame, with a column for each component in
/// `parts`.
fn quaternions(
    parts: &str,
    of: impl Fn(&FlightFrame) -> SegmentArray<UnitQuaternion<f64>>,
) -> String {
    let mut text = "time_ms,x,y,z".to_owned();
    for segment in Segment::ALL {
        for part in parts.chars() {
            let _ = write!(text, ",{}.{part}", segment.name());
        }
    }
    for (k, frame) in known().iter().enumerate() {
        let place = frame.pelvis.position.components;
        let _ = write!(
            text,
            "\n{},{:.4},{:.4},{:.4}",
            5 * k,
            place.x,
            place.y,
            place.z
        );
        let turned = of(frame);
        for q in turned.values() {
            for part in parts.chars() {
                let value = match part {
                    'w' => q.w,
                    'x' => q.i,
                    'y' => q.j,
                    _ => q.k,
                };
                let _ = write!(text, ",{value:.5}");
            }
        }
    }
    text
}

/// A mapping that assigns every segment the columns of its quaternion.
fn mapping(head: &str, parts: &str) -> String {
    let mut text = format!(
        "kind = \"quaternions\"\n[time]\ncolumn = \"time_ms\"\nunit_s = 0.001\n[position]\ncolumns = [\"x\", \"y\", \"z\"]\n{head}\n"
    );
    for segment in Segment::ALL {
        let name = segment.name();
        let columns: Vec<String> = parts
            .chars()
            .map(|part| format!("\"{name}.{part}\""))
            .collect();
        let _ = write!(
            text,
            "[segments.{name}]\ncolumns = [{}]\n",
            columns.join(", ")
        );
    }
    text
}

#[test]
fn a_flight_survives_quaternions_of_either_handedness_and_order() {
    let folder = tempfile::tempdir().expect("a folder");
    // Quaternions as a suit writes them: relative to the T-pose, X forward, Y left, Z up, scalar first, in earth axes.
    let table = quaternions("wxyz", |frame| {
        xsens::mvn_orientations(frame.pelvis.inertial_from_body, &frame.posture)
            .map(|_, turned| *turned.quaternion())
    });
    let file = written(folder.path(), "suit.csv", &table);
    let head = "[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\naxes = [\"forward\", \"left\", \"up\"]\nrest = \"t-pose\"\n";
    let map = written(folder.path(), "suit.toml", &mapping(head, "wxyz"));
    let (angles, places) = imported(folder.path(), &[&file, "--mapping", &map]);
    assert!(
        largest(&angles) < RETURNS && places < 1e-3,
        "{angles:?}, {places} m"
    );

    // Quaternions as a game engine writes them: left-handed, X right, Y up, Z forward, scalar last, in the axes of the
    // parent.
    let body_axes = Matrix3::from_columns(&[-Vector3::x(), Vector3::z(), -Vector3::y()]);
    let world_axes = Matrix3::from_columns(&[-Vector3::y(), Vector3::z(), Vector3::x()]);
    let table = quaternions("xyzw", |frame| {
        let world_from_segment = turned(frame).map(|_, turned| {
            world_axes.transpose() * turned.to_rotation_matrix().matrix() * body_axes
        });
        world_from_segment.map(|segment, own| {
            let parent = segment
                .parent()
                .map_or_else(Matrix3::identity, |parent| world_from_segment[parent]);
            let turn = Rotation3::from_matrix_unchecked(parent.transpose() * own);
            UnitQuaternion::from_rotation_matrix(&turn)
        })
    });
    let file = written(folder.path(), "engine.csv", &table);
    let head = "[world]\naxes = [\"east\", \"up\", \"north\"]\n[body]\naxes = [\"right\", \"up\", \"forward\"]\nrest = \"h-pose\"\n\
                [quaternions]\norder = \"xyzw\"\nrelative_to = \"parent\"\n";
    // Positions in this table stay in earth axes, so only attitudes are compared.
    let map = written(folder.path(), "engine.toml", &mapping(head, "xyzw"));
    let (angles, _) = imported(folder.path(), &[&file, "--mapping", &map]);
    assert!(largest(&angles) < RETURNS, "{angles:?}");
}

#[test]
fn a_flight_survives_conversion_to_points() {
    let folder = tempfile::tempdir().expect("a folder");
    let (names, frames) = points();
    let trc = written(folder.path(), "jump.trc", &trc(&names, &frames));
    let c3d = folder.path().join("jump.c3d");
    std::fs::write(&c3d, c3d::written(&names, &frames, 200.0)).expect("written");
    let map = points_mapping(folder.path());
    let nexus = written(folder.path(), "jump.csv", &nexus(&names, &frames));
    for file in [trc.as_str(), plain(&c3d), &nexus] {
        let (angles, places) = imported(folder.path(), &[file, "--mapping", &map]);
        assert!(largest(&angles) < RETURNS, "{file}: {angles:?}");
        assert!(places < 0.005, "{file}: {places} m");
    }
    let out = plain(&folder.path().join("new")).to_owned();
    let said = PROGRAM.fails(&["import", plain(&c3d), "--out", &out], 2);
    assert!(
        said.contains("this is a C3D file") && said.contains("--mapping"),
        "{said}"
    );
    let mut cut = std::fs::read(&c3d).expect("the file");
    cut.truncate(cut.len() / 2);
    std::fs::write(&c3d, cut).expect("written");
    let said = PROGRAM.fails(
        &["import", plain(&c3d), "--mapping", &map, "--out", &out],
        2,
    );
    assert!(
        said.contains("jump.c3d") && said.contains("ends early"),
        "{said}"
    );
}

#[test]
fn joint_angles_of_a_laboratory_are_its_flight() {
    let folder = tempfile::tempdir().expect("a folder");
    let (table, map) = (
        acrobatics("joint-angles-1.csv.gz"),
        acrobatics("joint-angles.toml"),
    );
    let subject = acrobatics("subject-1.toml");
    let arguments = [
        plain(&table),
        "--mapping",
        plain(&map),
        "--subject",
        plain(&subject),
    ];
    let (angles, places) = imported(folder.path(), &arguments);
    for (segment, angle) in angles.iter() {
        let most = match segment {
            // The laboratory's elbows and wrists turn about two axes only, so its own conversion is approximate.
            Segment::LeftForearm
            | Segment::RightForearm
            | Segment::LeftHand
            | Segment::RightHand => 1.0,
            // The table has no angles for the abdomen, which is put halfway between pelvis and thorax.
            Segment::Abdomen => 15.0,
            _ => RETURNS,
        };
        assert!(*angle < most, "{segment:?}: {angle}");
    }
    assert!(places < 1e-3, "{places} m");
    // The imported flight simulates like the recorded one, with no warnings except those about their length.
    let imported = folder.path().join("out/flight.toml");
    for flight in [imported, acrobatics("flight-1.toml")] {
        let report = PROGRAM.json(&["simulate", plain(&flight)]);
        let warnings = report["warnings"].as_array().expect("warnings");
        assert_eq!(warnings.len(), 1, "{report}");
        let said = warnings[0]["message"].as_str().expect("a sentence");
        assert!(said.contains("ends after 1.14 s"), "{said}");
    }
}

#[test]
fn a_mistake_in_axes_is_detected() {
    let folder = tempfile::tempdir().expect("a folder");
    let file = bvh::written(&xsens::t_pose(), str::to_owned);
    let out = plain(&folder.path().join("out")).to_owned();
    // The file with Y and Z exchanged, as another program might write it.
    let tilted = file.replace("OFFSET ", "OFFSET  ");
    let tilted: String = tilted
        .lines()
        .map(
            |line| match line.split_whitespace().collect::<Vec<_>>()[..] {
                ["OFFSET", x, y, z] => format!("OFFSET {x} -{z} {y}\n").replace("--", ""),
                _ => format!("{line}\n"),
            },
        )
        .collect();
    let path = written(folder.path(), "tilted.bvh", &tilted);
    let said = PROGRAM.fails(&["import", &path, "--out", &out], 2);
    assert!(
        said.contains("not above the hips") && said.contains("[body] axes"),
        "{said}"
    );
    // Knees that bend forwards reveal a wrong sign.
    let table = "knee,x,y,z\n90,0,0,0\n91,0,0,0\n92,0,0,0\n".to_owned();
    let table = written(folder.path(), "sit.csv", &table);
    for (column, is_wrong) in [("knee", false), ("-knee", true)] {
        let mut map = "kind = \"angles\"\n[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\naxes = [\"left\", \"back\", \"up\"]\n\
                       rest = \"h-pose\"\n[time]\nrate_hz = 100\n[position]\ncolumns = [\"x\", \"y\", \"z\"]\n"
            .to_owned();
        for segment in Segment::ALL {
            let _ = writeln!(map, "[segments.{}]", segment.name());
            if matches!(segment, Segment::LeftShank | Segment::RightShank) {
                let _ = writeln!(map, "rotations = \"x\"\ncolumns = [\"{column}\"]");
            }
        }
        let map = written(folder.path(), "sit.toml", &map);
        let output = PROGRAM.run(&[
            "import",
            &table,
            "--mapping",
            &map,
            "--out",
            &out,
            "--force",
        ]);
        let said = text(&output.stdout);
        let code = output.status.code();
        assert_eq!(code, Some(if is_wrong { 5 } else { 0 }), "{said}");
        assert_eq!(said.contains("knees are bent forwards"), is_wrong, "{said}");
        assert!(said.contains("no subject was given"), "{said}");
    }
}

#[test]
fn each_kind_of_broken_file_has_its_message() {
    let folder = tempfile::tempdir().expect("a folder");
    let out = plain(&folder.path().join("out")).to_owned();
    let map = plain(&acrobatics("joint-angles.toml")).to_owned();
    let head = "[world]\naxes = [\"north\", \"west\", \"up\"]\n[body]\naxes = [\"forward\", \"left\", \"up\"]\nrest = \"t-pose\"\n";
    let suit = written(folder.path(), "suit.toml", &mapping(head, "wxyz"));
    let good = quaternions("wxyz", turned);
    let long = good.lines().map(|line| {
        // The first quaternion of the third row has a norm above one.
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        if cells[0] == "10" {
            cells[4] = "1.5".to_owned();
        }
        cells.join(",") + "\n"
    });
    let long: String = long.collect();
    let whole = bvh::written(&xsens::t_pose(), str::to_owned);
    for (name, content, mapping, parts) in [
        (
            "a.bvh",
            whole[..whole.len() - 40].to_owned(),
            None,
            ["a.bvh:", "expected 51 numbers"],
        ),
        (
            "b.bvh",
            whole.replace("LeftUpLeg", "Bone7"),
            None,
            ["b.bvh", "Bone7"],
        ),
        ("c.bvh", good.clone(), None, ["c.bvh:1", "not a BVH file"]),
        (
            "d.csv",
            good.replace("l_thigh.w", "thigh"),
            Some(&suit),
            ["segments.l_thigh", "no column \"l_thigh.w\""],
        ),
        (
            "e.csv",
            long,
            Some(&suit),
            ["e.csv:4: segments.pelvis", "unit length"],
        ),
        (
            "f.csv",
            good.replace("\n20,", "\n22,"),
            Some(&suit),
            ["f.csv:6", "even times"],
        ),
        (
            "g.csv",
            good.replace("\n20,", "\nx,"),
            Some(&suit),
            ["g.csv:6", "found \"x\""],
        ),
        (
            "h.csv",
            "Pelvis_x,Pelvis_y\n1,2\n3,4\n".to_owned(),
            Some(&map),
            ["h.csv", "no column"],
        ),
        (
            "i.trc",
            "PathFileType\t4\n".to_owned(),
            Some(&map),
            ["i.trc", "ends early"],
        ),
        (
            "j.mot",
            "Coordinates\nendheader\n".to_owned(),
            Some(&map),
            ["j.mot", "empty table"],
        ),
    ] {
        let file = written(folder.path(), name, &content);
        let mut arguments = vec!["import", &file, "--out", &out];
        arguments.extend(
            mapping
                .map(|map| ["--mapping", map.as_str()])
                .into_iter()
                .flatten(),
        );
        let said = PROGRAM.fails(&arguments, 2);
        for part in parts {
            assert!(said.contains(part), "{name}: {said}\nlacks {part}");
        }
        let flight = folder.path().join("out/flight.mvnx");
        assert!(!flight.exists(), "{name}");
    }
}
