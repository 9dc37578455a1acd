//! Files of other systems on which readers go wrong: each is read right, or refused.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

use std::path::{Path, PathBuf};

use bodyflight_core::{Posture, Segment};
use bodyflight_mocap::mapping::Mapping;
use bodyflight_mocap::source::Source;
use bodyflight_shared_data::shared;
use nalgebra::{UnitQuaternion, Vector3};

/// The file of a case, or `None` with a visible notice.
fn case(name: &str) -> Option<PathBuf> {
    shared(&format!("cases/mocap/{name}"))
}

/// A case as postures, one for each frame, with the rate and the warnings.
struct Read {
    postures: Vec<Posture<f64>>,
    attitudes: Vec<UnitQuaternion<f64>>,
    rate: f64,
    warnings: String,
    unit_m: f64,
    names: String,
}

fn read(file: &Path, mapping: Option<&Path>) -> Read {
    let mapping = mapping.map(|path| Mapping::read(path).expect("a mapping"));
    let mut source = Source::open(file, mapping.as_ref()).expect("a source");
    let mut postures = Vec::new();
    let mut attitudes = Vec::new();
    for place in 0..source.frames() {
        let frame = source.frame(place).expect("a frame");
        let (attitude, posture) = source.skeleton.posture(&frame.world_from_segment);
        postures.push(posture);
        attitudes.push(*attitude.quaternion());
    }
    Read {
        postures,
        attitudes,
        rate: source.timing.rate,
        warnings: source.warnings.join("\n"),
        unit_m: source.unit_m,
        names: format!("{:?}", source.names),
    }
}

/// Angular velocities of a joint (rad/s) in the axes of the segment.
fn rates(read: &Read, segment: Segment) -> impl Iterator<Item = Vector3<f64>> {
    let is_finite = |posture: &Posture<f64>| {
        posture
            .parent_from_segment(segment)
            .coords
            .norm()
            .is_finite()
    };
    assert!(
        read.postures.iter().all(is_finite),
        "{segment:?} has no attitude"
    );
    read.postures.windows(2).map(move |pair| {
        let [from, to] = [0, 1].map(|k: usize| pair[k].parent_from_segment(segment));
        (from.inverse() * to).scaled_axis() * read.rate
    })
}

/// The fastest joint (rad/s).
fn fastest(read: &Read) -> f64 {
    let joints = Segment::ALL
        .into_iter()
        .flat_map(|segment| rates(read, segment));
    joints.map(|rate| rate.norm()).fold(0.0, f64::max)
}

#[test]
fn arms_near_and_past_the_left_axis_do_not_spin() {
    for name in ["t-pose.csv", "arms-raise-2deg.csv", "arms-raise-6deg.csv"] {
        let Some((file, map)) = case(name).zip(case("points.toml")) else {
            return;
        };
        let read = read(&file, Some(&map));
        for arm in [Segment::LeftUpperArm, Segment::RightUpperArm] {
            let spin = rates(&read, arm)
                .map(|rate| rate.z.abs())
                .fold(0.0, f64::max);
            assert!(spin < 0.5, "{name}: {arm:?} spins at {spin} rad/s");
        }
        assert!(read.warnings.is_empty(), "{name}: {}", read.warnings);
    }
}

#[test]
fn points_without_a_unit_are_taken_in_the_unit_of_a_person() {
    let Some((file, map)) = case("t-pose.csv").zip(case("points.toml")) else {
        return;
    };
    let metres = read(&file, Some(&map));
    assert!((metres.unit_m - 1.0).abs() < 1e-12 && metres.warnings.is_empty());
    let text = std::fs::read_to_string(&file).expect("the case");
    let (head, rows) = text.split_once('\n').expect("rows");
    let row = |line: &str| {
        let scaled = line.split(',').enumerate().map(|(column, word)| {
            let value: f64 = word.trim().parse().expect("a number");
            (if column == 0 { value } else { value * 1000.0 }).to_string()
        });
        scaled.collect::<Vec<_>>().join(",")
    };
    let rows: Vec<String> = rows.lines().map(row).collect();
    let folder = tempfile::tempdir().expect("a folder");
    let millimetres = folder.path().join("millimetres.csv");
    std::fs::write(&millimetres, format!("{head}\n{}\n", rows.join("\n"))).expect("a file");
    let read = read(&millimetres, Some(&map));
    assert!((read.unit_m - 1e-3).abs() < 1e-12, "{}", read.unit_m);
    assert!(
        read.warnings.contains("states no unit"),
        "{}",
        read.warnings
    );
}

#[test]
fn the_upper_of_two_joints_of_the_spine_is_the_thorax() {
    let Some(file) = case("chest-chest2.bvh") else {
        return;
    };
    let read = read(&file, None);
    let turned = |segment: Segment| {
        let angles = read
            .postures
            .iter()
            .map(|posture| posture.body_from_segments()[segment].angle());
        angles.fold(0.0, f64::max).to_degrees()
    };
    assert!(
        (turned(Segment::Thorax) - 30.0).abs() < 0.1,
        "{}",
        turned(Segment::Thorax)
    );
    assert!(
        turned(Segment::Abdomen) < 0.1,
        "{}",
        turned(Segment::Abdomen)
    );
}

#[test]
fn a_rest_posture_in_frame_0_is_left_out_and_named() {
    for name in ["zero-frame.bvh", "no-zero-frame.bvh"] {
        let Some(file) = case(name) else { return };
        let read = read(&file, None);
        let text = std::fs::read_to_string(&file).expect("text");
        let frames = text.lines().find_map(|line| line.strip_prefix("Frames:"));
        let frames: usize = frames.expect("a count").trim().parse().expect("a number");
        let dropped = frames - read.postures.len();
        assert_eq!(
            dropped == 1,
            read.warnings.contains("frame 0 is a rest posture"),
            "{name}"
        );
        assert_eq!(dropped, usize::from(name == "zero-frame.bvh"), "{name}");
        assert!(fastest(&read) < 15.0, "{name}: {} rad/s", fastest(&read));
    }
}

#[test]
fn spellings_of_bvh_are_one_motion() {
    let files = ["b_bom.bvh", "b_poser-names.bvh", "b_NTSC-29.97.bvh"].map(case);
    let [Some(bom), Some(poser), Some(video)] = files else {
        return;
    };
    let [bom, poser, video] = [bom, poser, video].map(|file| read(&file, None));
    for (rate, right) in [
        (bom.rate, 120.0),
        (poser.rate, 120.0),
        (video.rate, 30.0 / 1.001),
    ] {
        assert!((rate - right).abs() < 1e-9, "{rate} instead of {right}");
    }
    for other in [&poser, &video] {
        assert_eq!(bom.postures.len(), other.postures.len());
        let pairs = bom.postures.iter().zip(&other.postures);
        for (a, b) in pairs {
            for segment in [Segment::Thorax, Segment::LeftForearm, Segment::RightShank] {
                let [a, b] = [a, b].map(|posture| posture.parent_from_segment(segment));
                assert!(
                    a.angle_to(b) < 0.01,
                    "{segment:?}: {}, {}",
                    bom.names,
                    other.names
                );
            }
        }
    }
    assert!(
        bom.warnings.contains(&format!("{:.6} m", bom.unit_m)),
        "{}",
        bom.warnings
    );
}

#[test]
fn angles_of_opensim_are_radians_by_statement_and_by_default() {
    for name in ["radians-by-text.sto", "radians-no-statement.sto"] {
        let Some((file, map)) = case(name).zip(case("mot.toml")) else {
            return;
        };
        let read = read(&file, Some(&map));
        let knees = read
            .postures
            .iter()
            .map(|p| p.parent_from_segment(Segment::LeftShank).angle());
        let bent = knees.fold(0.0, f64::max);
        assert!((0.5..2.8).contains(&bent), "{name}: {bent} rad");
        assert!(
            !read.attitudes.is_empty() && read.warnings.is_empty(),
            "{}",
            read.warnings
        );
    }
}
