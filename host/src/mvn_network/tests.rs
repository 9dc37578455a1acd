//! Datagrams there and back, damaged, lost and overtaken.

use bodyflight_core::frame::{Rotation, Vector};
use bodyflight_core::{Posture, Segment};
use proptest::prelude::*;

use super::*;

fn frame(index: u64) -> FlightFrame {
    #[expect(clippy::cast_precision_loss, reason = "small")]
    let time = index as f64 / 240.0;
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -1.2, time));
    FlightFrame {
        index,
        time,
        posture: Posture::h_pose()
            .with_angles(Segment::LeftUpperArm, 0.2, 1.2, -0.4)
            .with_angles(Segment::RightHand, -0.3, 0.1, time)
            .with_angles(Segment::Thorax, 0.1, 0.0, 0.3),
        pelvis: PelvisMotion {
            inertial_from_body: Rotation::from_quaternion(turn),
            position: Vector::new(1.0, 2.0, 3.0),
            velocity: Some(Vector::new(3.0, -4.0, -50.0)),
            angular_velocity: Some(Vector::new(0.1, 0.2, -0.3)),
        },
        centre_of_mass: None,
        bridged: false,
    }
}

fn datagrams(count: u64) -> Vec<Vec<u8>> {
    (0..count)
        .flat_map(|k| datagram::of_frame(&frame(k), u32::try_from(k).unwrap() + 7))
        .collect()
}

fn same(found: &FlightFrame, sent: &FlightFrame) {
    for segment in Segment::ALL {
        let [a, b] = [&found.posture, &sent.posture].map(|p| p.parent_from_segment(segment));
        assert!(a.angle_to(b) < 1e-6, "{segment:?}");
    }
    let attitude = |frame: &FlightFrame| *frame.pelvis.inertial_from_body.quaternion();
    assert!(attitude(found).angle_to(&attitude(sent)) < 1e-6);
    let off = |a: Vector<f64, bodyflight_core::frame::Inertial>, b: Vector<f64, _>| {
        (a.components - b.components).norm()
    };
    assert!(
        off(
            found.pelvis.velocity.unwrap(),
            sent.pelvis.velocity.unwrap()
        ) < 1e-5
    );
    let [a, b] = [found, sent].map(|frame| frame.pelvis.angular_velocity.unwrap());
    assert!(off(a, b) < 1e-6);
    assert!(off(found.pelvis.position, sent.pelvis.position) < 1e-6);
    assert!((found.time - sent.time).abs() < 0.6e-3);
}

#[test]
fn frames_survive_the_way() {
    let mut assembler = Assembler::new();
    let found: Vec<_> = datagrams(5)
        .iter()
        .flat_map(|d| assembler.push(d))
        .collect();
    // The very first goes out with its pose alone: what else there is was not known yet.
    assert_eq!(found.len(), 5);
    for (k, found) in (0..).zip(&found).skip(1) {
        assert_eq!(found.index, k);
        same(found, &frame(k));
    }
    assert_eq!(assembler.counters().missing, 0);
}

#[test]
fn frames_survive_a_socket() {
    let mut source = Source::bind("127.0.0.1:0").unwrap();
    let mut sink = Sink::connect(&source.address()).unwrap();
    for k in 0..20 {
        sink.send(&frame(k));
    }
    for k in 0..20 {
        let found = source.next().unwrap().unwrap();
        assert_eq!(found.index, k);
        if k > 0 {
            same(&found, &frame(k));
        }
    }
}

#[test]
fn lost_repeated_and_overtaken_datagrams_are_counted() {
    let mut all = datagrams(10);
    // Sample 3 is lost, of sample 5 the velocity; 12 and 13 of sample 4 come in another order; one comes twice.
    all[12..15].reverse();
    all.remove(16);
    all.drain(9..12);
    let repeated = all[4].clone();
    all.insert(6, repeated);
    let mut assembler = Assembler::new();
    let found: Vec<_> = all.iter().flat_map(|d| assembler.push(d)).collect();
    let numbers: Vec<u64> = found.iter().map(|frame| frame.index).collect();
    assert_eq!(numbers, [0, 1, 2, 4, 5, 6, 7, 8, 9]);
    let counters = assembler.counters();
    assert_eq!((counters.missing, counters.samples), (1, 9));
    assert!(counters.late >= 1);
    assert!(found[4].pelvis.velocity.is_none());
    assert!(found[5].pelvis.velocity.is_some());
}

#[test]
fn what_is_not_of_mvn_is_counted() {
    let mut assembler = Assembler::new();
    let mut wrong_order = datagrams(1).remove(0);
    wrong_order[27] = 9;
    let mut broken = datagrams(1).remove(0);
    broken[40..56].fill(0xFF);
    let scale = [b"MXTP13".as_slice(), &[0; 30]].concat();
    for (bytes, expected) in [
        (b"hello".to_vec(), [1, 0, 0]),
        (vec![0; 100], [2, 0, 0]),
        (scale, [2, 1, 0]),
        (wrong_order, [2, 1, 1]),
        (broken, [2, 1, 2]),
    ] {
        assert_eq!(assembler.push(&bytes).len(), 0);
        let Counters {
            foreign,
            unused,
            malformed,
            ..
        } = *assembler.counters();
        assert_eq!([foreign, unused, malformed], expected);
    }
}

proptest! {
    #[test]
    fn no_bytes_bring_it_down(
        bytes in prop::collection::vec(any::<u8>(), 0..900),
        kind in prop::sample::select(vec!["02", "21", "22", "99"]),
        place in 0usize..800,
    ) {
        let mut assembler = Assembler::new();
        assembler.push(&bytes);
        let header = [b"MXTP", kind.as_bytes()].concat();
        assembler.push(&[&header[..], &bytes].concat());
        let mut damaged = datagrams(1).remove(0);
        damaged.truncate(place);
        assembler.push(&damaged);
        prop_assert_eq!(assembler.counters().datagrams, 3);
    }
}
