//! The arm convention of a file does not affect the postures, and real files agree with their own skeletons.

use std::path::Path;

use bodyflight_core::Segment;
use bodyflight_mvnx::closure::t_pose_from_isb;
use bodyflight_mvnx::recording::{FlightFrame, Options, Recording};
use bodyflight_mvnx::xsens::{self, MvnSegment};
use bodyflight_mvnx::{ArmFrame, Field, Frame, FrameKind, Header, ReadOptions, Reader};
use bodyflight_tests::data_folder;
use bodyflight_tests::small_recording::{NAME, read, with_numbers, written};
use bodyflight_verbs::inspect::inspect;
use nalgebra::{Quaternion, UnitQuaternion};

/// Rewrites the arms of every frame in ISB axes, as in version 3.
#[test]
fn the_arm_convention_makes_no_difference() {
    let text = written(5);
    let turned = |all: &str| {
        let numbers: Vec<f64> = all
            .split(' ')
            .map(|n| n.parse().expect("a number"))
            .collect();
        let turned = numbers
            .chunks(4)
            .zip(MvnSegment::ALL)
            .flat_map(|(q, segment)| {
                let q = Quaternion::new(q[0], q[1], q[2], q[3]);
                let q = q * t_pose_from_isb(segment.label()).quaternion();
                [q.w, q.i, q.j, q.k]
            });
        turned
            .map(|n| format!("{n:.6}"))
            .collect::<Vec<_>>()
            .join(" ")
    };
    // Drop the calibration frames, which would still use the other convention.
    let first = text.find("<frame time=\"0\" tc").expect("calibration");
    let normal = text
        .find("<frame time=\"0\" index")
        .expect("a normal frame");
    let mut isb = format!("{}{}", &text[..first], &text[normal..]);
    for index in 0..5 {
        isb = with_numbers(&isb, index, "orientation", turned);
    }
    let recording = Recording::new(isb.as_bytes(), Path::new(NAME), Options::default());
    assert_eq!(recording.expect("good").arm_frame().0, ArmFrame::Isb);
    let ((found, _), (expected, _)) = (
        read(isb.as_bytes()).expect("good"),
        read(text.as_bytes()).expect("good"),
    );
    for (found, expected) in found.iter().zip(&expected) {
        for segment in Segment::ALL {
            let [a, b] = [found, expected].map(|f| *f.posture.parent_from_segment(segment));
            assert!(a.angle_to(&b) < 1e-5, "{segment:?}");
        }
    }
}

#[test]
fn real_files_agree_with_their_own_skeleton() {
    for (name, version, fields, mass_numbers) in [
        ("mvnx/robotology-xsens-mvn/Meri-020.mvnx", 3, 13, 3),
        ("mvnx/andres-fr-blender-mvnx-io/test_mocap.mvnx", 4, 14, 3),
    ] {
        let Some(folder) = data_folder() else { return };
        let path = folder.join(name);
        let report = inspect(&path, None).expect("surveyed");
        assert_eq!(
            (report.version, report.segments, report.bad_frames),
            (version, 23, 0)
        );
        assert_eq!(report.fields.len(), fields, "{:?}", report.fields);
        assert!(report.closure_error_m.expect("joints") < 0.002);
        let isb = report.arm_frame == Some("isb");
        let mut reader = Reader::open(&path, ReadOptions::default()).expect("a recording");
        let header = reader.header().clone();
        let recording = Recording::open(&path, Options::default()).expect("a flight");
        let mut frame = Frame::default();
        let mut largest = 0.0f64;
        for flight in recording {
            let flight = flight.expect("good");
            assert!(reader.next_frame(&mut frame).expect("good"));
            assert_eq!(
                frame.numbers(Field::CenterOfMass).map(<[f64]>::len),
                Some(mass_numbers)
            );
            let orientations = orientations_of(&header, &frame, &flight, isb, name);
            largest = largest.max(joint_gap(&header, &frame, &orientations, isb));
        }
        println!("{name}: joints reproduced to {:.2} mm", largest * 1e3);
        assert!(largest < 0.005, "{name}: {largest} m");
        arms_are_straight_out(&path, name);
    }
    let Some(folder) = data_folder() else { return };
    let odd = folder.join("mvnx/x-biosignal-PhysioDevices/xsens_sample.mvnx");
    let report = inspect(&odd, None).expect("surveyed");
    assert_eq!(
        (report.frames, report.segments, report.arm_frame),
        (2, 2, None)
    );
    let problem = Recording::open(&odd, Options::default())
        .err()
        .expect("no full body");
    assert!(problem.message.contains("RightUpperArm"), "{problem}");
}

/// Returns the orientations of the file's segments, with the arms in the file's convention, after asserting that the
/// posture converts back to them.
fn orientations_of(
    header: &Header,
    frame: &Frame,
    flight: &FlightFrame,
    isb: bool,
    name: &str,
) -> Vec<UnitQuaternion<f64>> {
    let recorded = frame.numbers(Field::Orientation).expect("orientation");
    let given = xsens::mvn_orientations(flight.pelvis.inertial_from_body, &flight.posture);
    let mut orientations: Vec<UnitQuaternion<f64>> = recorded
        .chunks(4)
        .map(|q| UnitQuaternion::new_normalize(Quaternion::new(q[0], q[1], q[2], q[3])))
        .collect();
    for segment in Segment::ALL {
        let mvn = MvnSegment::leading(segment);
        let place = header.segment_index(mvn.label()).expect("23 segments");
        let mut found = *given[segment].quaternion();
        if isb {
            found *= t_pose_from_isb(mvn.label());
        }
        assert!(
            found.angle_to(&orientations[place]) < 1e-5,
            "{name} {segment:?}"
        );
        orientations[place] = found;
    }
    orientations
}

/// Largest distance (m) between a segment's position in the file and its position computed along the joints, outwards
/// from the pelvis.
fn joint_gap(
    header: &Header,
    frame: &Frame,
    orientations: &[UnitQuaternion<f64>],
    isb: bool,
) -> f64 {
    let mut largest = 0.0f64;
    let mut positions = vec![frame.vector(Field::Position, 0).expect("position")];
    for child in &MvnSegment::ALL[1..] {
        let parent = child.parent().expect("not the root") as usize;
        let joint = header
            .joints
            .iter()
            .find(|j| j.connectors[1].starts_with(&format!("{}/", child.label())))
            .expect("its joint");
        let [at_parent, at_child] = [0, 1].map(|end| {
            let (segment, point) = joint.connectors[end].split_once('/').expect("a point");
            let segment = header.segment_index(segment).expect("a segment");
            let axes = match isb {
                true => t_pose_from_isb(&header.segments[segment].label).inverse(),
                false => UnitQuaternion::identity(),
            };
            let point = header.segments[segment].point(point).expect("a point");
            orientations[segment] * axes * point
        });
        let position = positions[parent] + at_parent - at_child;
        let expected = frame
            .vector(Field::Position, *child as usize)
            .expect("position");
        largest = largest.max((position - expected).norm());
        positions.push(position);
    }
    largest
}

/// Asserts that the arms point straight out to the sides in the calibration frames, whatever the file's convention.
fn arms_are_straight_out(path: &Path, name: &str) {
    let recording = Recording::open(path, Options::default()).expect("a flight");
    let t_pose = recording.calibration(FrameKind::Tpose).expect("a T-pose");
    for (segment, side) in [(Segment::LeftForearm, 1.0), (Segment::RightForearm, -1.0)] {
        let distal = t_pose.posture.body_from_segments()[segment] * -nalgebra::Vector3::z();
        assert!(distal.x * side > 0.99, "{name} {segment:?}: {distal:?}");
    }
    if let Some(isb) = recording.calibration(FrameKind::TposeIsb) {
        for segment in Segment::ALL {
            let [a, b] = [&isb, &t_pose].map(|f| *f.posture.parent_from_segment(segment));
            assert!(a.angle_to(&b) < 1e-5, "{segment:?}");
        }
    }
}
