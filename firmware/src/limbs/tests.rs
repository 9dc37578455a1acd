//! Sensors on a person who does what the test says, each turned about its own segment.

use std::vec::Vec;

use bodyflight_core::air::STANDARD_GRAVITY;
use bodyflight_core::chain::{Packet, Rounding};
use bodyflight_core::link::SegmentTable;
use bodyflight_core::math::rotation_by;
use bodyflight_core::suit::placement::of_size;
use nalgebra::UnitQuaternion;
use proptest::prelude::*;

use super::*;
use crate::sensor::rvc;
use crate::sensor::rvc_suit::RvcSuit;
use crate::test_flight::{configure, table};

fn body() -> Body<f32> {
    let table: SegmentTable = table();
    table.body(configure().height, table.digest()).unwrap()
}

/// Tilt about the left axis, forwards positive (rad), of a segment in a pose at a time (s).
#[derive(Clone, Copy, PartialEq)]
enum Pose {
    Upright,
    Bent,
    March,
    /// Walks about.
    Moving,
}

fn tilt(segment: Segment, pose: Pose, time: f32) -> f32 {
    let (sine, cosine) = (core::f32::consts::PI * time).sine_cosine();
    match (pose, segment) {
        (Pose::Upright, _) => 0.0,
        (Pose::Moving, _) => 0.5 * sine,
        (Pose::Bent, Segment::Pelvis | Segment::Thorax) => 1.3,
        (Pose::Bent, Segment::LeftThigh | Segment::RightThigh) => -0.5,
        (Pose::Bent, Segment::LeftShank | Segment::RightShank) => 0.4,
        (Pose::Bent, _) => 0.0,
        (Pose::March, Segment::Pelvis | Segment::Thorax) => 0.02 * sine,
        // Whole swings that begin and end upright.
        (Pose::March, Segment::LeftShank | Segment::RightShank) => 0.4 * (1.0 - cosine),
        (Pose::March, _) => -0.4 * (1.0 - cosine),
    }
}

/// A person with sensors.
struct Person {
    segments: Vec<Segment>,
    roundings: Vec<Rounding>,
    cycle: u16,
    pose: Pose,
    /// Time in the present pose (s).
    time: f32,
    bias: Vector3<f32>,
    /// Sensors with lines of their own in place of nodes.
    suit: Option<RvcSuit>,
}

impl Person {
    fn new(segments: &[Segment]) -> Self {
        Self {
            segments: segments.to_vec(),
            roundings: segments.iter().map(|_| Rounding::default()).collect(),
            cycle: 0,
            pose: Pose::Upright,
            time: 0.0,
            bias: Vector3::new(0.01, -0.02, 0.005),
            suit: None,
        }
    }

    fn mounted(segment: Segment) -> UnitQuaternion<f32> {
        let turn = f32::from(segment as u8);
        rotation_by(&Vector3::new(0.3, 0.2 * turn - 1.0, 0.4 * turn))
    }

    /// Tilt now, on the way from one pose to the next for half a second.
    fn tilt(&self, segment: Segment, before: Pose, time: f32) -> f32 {
        let share = (time / 0.5).clamp(0.0, 1.0);
        let share = share * share * (3.0 - 2.0 * share);
        (1.0 - share) * tilt(segment, before, 0.0) + share * tilt(segment, self.pose, time)
    }

    /// Holds a pose for some time (s); returns the pelvis's readings.
    fn hold(&mut self, limbs: &mut Limbs, pose: Pose, seconds: f32) -> Vec<PelvisReading> {
        let before = core::mem::replace(&mut self.pose, pose);
        self.time = 0.0;
        let mut found = Vec::new();
        let body = body();
        let mut roundings = core::mem::take(&mut self.roundings);
        while self.time < seconds {
            self.cycle = self.cycle.wrapping_add(1);
            self.time += 0.01;
            let mut line = Vec::new();
            // A sensor without any noise is dead.
            let noise = if self.cycle.is_multiple_of(2) {
                0.003
            } else {
                -0.003
            };
            for (segment, rounding) in self.segments.iter().zip(&mut roundings) {
                let tilts =
                    [-0.005, 0.0, 0.005].map(|d| self.tilt(*segment, before, self.time + d));
                let to_sensor = Self::mounted(*segment).inverse();
                let rate = Vector3::x() * ((tilts[2] - tilts[0]) / 0.01);
                let up = rotation_by(&(Vector3::x() * -tilts[1])) * Vector3::z();
                let reading = Reading {
                    angular_velocity: to_sensor * rate + self.bias.add_scalar(noise),
                    specific_force: to_sensor * up * f32::of(STANDARD_GRAVITY),
                };
                if let Some(suit) = &mut self.suit {
                    let attitude = rotation_by(&(Vector3::x() * tilts[1]));
                    let attitude = attitude * Self::mounted(*segment);
                    let force = reading.specific_force.add_scalar(noise);
                    let [index, _] = self.cycle.to_le_bytes();
                    let place = ten().iter().position(|one| one == segment).unwrap();
                    for byte in rvc::packet(index, &attitude, &force) {
                        suit.take(place, byte, 10_000 * u64::from(self.cycle));
                    }
                    continue;
                }
                let [rates, forces] = rounding.counts(&reading);
                let packet = Packet {
                    segment: *segment,
                    cycle: self.cycle,
                    time: u32::from(self.cycle) * 10_000,
                    age: 10,
                    rates,
                    forces,
                };
                line.extend(packet.encode());
            }
            if let Some(suit) = &mut self.suit {
                while let Some(packet) = suit.packet(10_000 * u64::from(self.cycle)) {
                    line.extend(packet);
                }
            }
            let mut input = &line[..];
            while let Some(reading) = limbs.next(&mut input, Some(&body)) {
                found.push(reading);
            }
        }
        self.roundings = roundings;
        found
    }

    /// The poses of a calibration.
    fn calibrate(&mut self, limbs: &mut Limbs) {
        self.calibrate_after(limbs, 1.5);
    }

    /// The same, upright for some time between bend and march (s).
    fn calibrate_after(&mut self, limbs: &mut Limbs, upright: f32) {
        for (pose, seconds) in [
            (Pose::Moving, 2.0),
            (Pose::Upright, 4.0),
            (Pose::Bent, 4.0),
            (Pose::Upright, upright),
            (Pose::March, 6.0),
            (Pose::Upright, 4.0),
        ] {
            self.hold(limbs, pose, seconds);
        }
    }
}

fn ten() -> &'static [Segment] {
    of_size(10).unwrap()
}

/// A person whose sensors are calibrated and worn.
fn worn() -> (Person, Limbs) {
    let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
    person.calibrate(&mut limbs);
    let found = limbs.calibration();
    assert_eq!(found.stage, CalibrationStage::Worn, "{found:?}");
    (person, limbs)
}

#[test]
fn poses_alone_calibrate_and_postures_follow() {
    let (mut person, mut limbs) = worn();
    assert_eq!(limbs.calibration().verdict, CalibrationVerdict::Good);
    assert!(limbs.is_to_store() && !limbs.is_to_store());
    assert_eq!(limbs.table().rows().count(), 10);
    for row in limbs.table().rows() {
        let off = row.fitted().mounting.segment_from_sensor;
        let off = off.angle_to(&Person::mounted(row.segment));
        assert!(off < 0.02, "{:?} {off}", row.segment);
        let bias = Vector3::from(row.bias) - person.bias;
        assert!(bias.norm() < 2e-3, "{:?} {bias}", row.segment);
    }
    let before = usize::from(person.cycle);
    let readings = person.hold(&mut limbs, Pose::Bent, 2.0);
    // Each cycle ends with its last node.
    assert_eq!(readings.len(), usize::from(person.cycle) - before);
    let last = readings.last().unwrap();
    assert!(last.angular_velocity.norm() < 1e-2, "{last:?}");
    assert!((last.specific_force.y.abs() - 9.45).abs() < 0.1, "{last:?}");
    let cycles = u32::try_from(readings.len()).unwrap() - 1;
    assert_eq!(last.fine_time - readings[0].fine_time, cycles * 100);
    let posture = limbs.posture().unwrap();
    let turned = |segment: Segment| posture.body_from_segments()[segment].scaled_axis().x;
    for segment in ten() {
        let expected = tilt(*segment, Pose::Bent, 0.0) - tilt(Segment::Pelvis, Pose::Bent, 0.0);
        let found = turned(*segment);
        assert!(
            (found - expected).abs() < 0.05,
            "{segment:?} {found} {expected}"
        );
    }
    let errors = limbs.new_errors().unwrap();
    assert_eq!(errors.failed, 0);
    assert_eq!(limbs.new_errors(), None, "only when they change");
}

/// BNO08x in their UART-RVC mode, which send no angular velocity.
#[test]
fn attitudes_alone_calibrate_and_postures_follow() {
    let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
    person.suit = Some(RvcSuit::new());
    person.calibrate(&mut limbs);
    let found = limbs.calibration();
    assert_eq!(found.stage, CalibrationStage::Worn, "{found:?}");
    assert_eq!(limbs.table().rows().count(), 10);
    for row in limbs.table().rows() {
        let off = row.fitted().mounting.segment_from_sensor;
        let off = off.angle_to(&Person::mounted(row.segment)).to_degrees();
        assert!(off < 2.0, "{:?} {off}", row.segment);
    }
    person.hold(&mut limbs, Pose::Bent, 4.0);
    let posture = limbs.posture().unwrap();
    for segment in ten() {
        let expected = tilt(*segment, Pose::Bent, 0.0) - tilt(Segment::Pelvis, Pose::Bent, 0.0);
        let found = posture.body_from_segments()[*segment].scaled_axis().x;
        let off = (found - expected).to_degrees().abs();
        assert!(off < 3.0, "{segment:?} {off}");
    }
    assert_eq!(limbs.new_errors().unwrap().failed, 0);
}

#[test]
fn who_moves_is_not_calibrated_and_a_refusal_names_the_sensor() {
    let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
    person.hold(&mut limbs, Pose::Moving, 30.0);
    let found = limbs.calibration();
    assert_eq!((found.stage, found.rests), (CalibrationStage::Poses, 0));
    assert_eq!(limbs.posture(), None);
    for (segments, verdict) in [
        (&ten()[1..], CalibrationVerdict::NoPelvis),
        (&Segment::ALL[..], CalibrationVerdict::TooMany),
    ] {
        let (mut person, mut limbs) = (Person::new(segments), Limbs::new());
        person.calibrate(&mut limbs);
        let found = limbs.calibration();
        assert_eq!(
            (found.stage, found.verdict),
            (CalibrationStage::Poses, verdict)
        );
        assert!(limbs.table().is_empty() && limbs.posture().is_none());
    }
    // Who stands still instead of marching shows no heading of the arms.
    let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
    for pose in [Pose::Upright, Pose::Bent] {
        person.hold(&mut limbs, pose, 4.0);
    }
    person.hold(&mut limbs, Pose::Upright, 1.0);
    // Shakes, without swinging to one side.
    person.hold(&mut limbs, Pose::Moving, 6.0);
    person.hold(&mut limbs, Pose::Upright, 4.0);
    let found = limbs.calibration();
    assert_eq!(found.verdict, CalibrationVerdict::NoHeading, "{found:?}");
    assert_eq!(found.segment, Segment::LeftUpperArm);
}

#[test]
fn a_node_that_dies_or_is_missing_leaves_its_segment_to_the_rule() {
    let (mut person, mut limbs) = worn();
    let table = *limbs.table();
    limbs.new_errors();
    let shank = Segment::LeftShank;
    let bit = 1 << shank as u8;
    person.segments.retain(|segment| *segment != shank);
    person.hold(&mut limbs, Pose::Upright, 1.0);
    let errors = limbs.new_errors().unwrap();
    assert_eq!(errors.failed, bit);
    let degrees = errors.deviations()[shank].to_degrees();
    assert!((15.0..40.0).contains(&degrees), "{degrees}");
    // Neutral to its thigh.
    let knee = |limbs: &Limbs| {
        let posture = limbs.posture().unwrap();
        posture.parent_from_segment(shank).scaled_axis().x
    };
    let neutral = bodyflight_core::body::pattern::neutral::<f32>();
    let expected = neutral.parent_from_segment(shank).scaled_axis().x;
    assert!((knee(&limbs) - expected).abs() < 1e-3);
    assert!(limbs.report().unwrap().missing[shank as usize] > 90);
    // Switched on again without it: as soon as the person stands upright.
    let mut again = Limbs::new();
    again.set_table(&table);
    let readings = person.hold(&mut again, Pose::Bent, 3.0);
    assert!(!readings.is_empty(), "the pelvis's motion does not wait");
    assert_eq!(again.calibration().stage, CalibrationStage::Waiting);
    assert_eq!(again.posture(), None);
    person.hold(&mut again, Pose::Upright, 3.5);
    assert_eq!(again.calibration().stage, CalibrationStage::Worn);
    assert_eq!(again.new_errors().unwrap().failed, bit);
    assert!(!again.is_to_store());
    // A line that was silent for long.
    person.cycle = person.cycle.wrapping_add(100);
    person.hold(&mut again, Pose::Bent, 1.0);
    assert_eq!(again.posture(), None);
    again.calibrate();
    assert_eq!(again.calibration().stage, CalibrationStage::Poses);
}

#[test]
fn standing_upright_before_the_march_is_allowed_for_any_time() {
    for upright in [0.2, 2.6, 20.0] {
        let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
        person.calibrate_after(&mut limbs, upright);
        let found = limbs.calibration();
        assert_eq!(
            found.stage,
            CalibrationStage::Worn,
            "{upright} s: {found:?}"
        );
    }
}

#[test]
fn the_state_is_told_when_it_changes() {
    let (mut person, mut limbs) = (Person::new(ten()), Limbs::new());
    assert_eq!(limbs.news(), None, "no line");
    person.hold(&mut limbs, Pose::Moving, 1.0);
    let first = limbs.news().unwrap();
    assert_eq!(first.heard.count_ones(), 10);
    person.hold(&mut limbs, Pose::Moving, 1.0);
    assert_eq!(limbs.news(), None);
    person.hold(&mut limbs, Pose::Upright, 4.0);
    assert_eq!(limbs.news().unwrap().rests, 1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    /// Whatever the nodes send, numbers stay numbers and nothing stops.
    #[test]
    fn no_packets_break_it(
        is_worn in any::<bool>(),
        packets in prop::collection::vec(
            (0..16_usize, any::<[i16; 6]>(), 0_u32..700_000, any::<u8>(), 0_u16..3), 1..400),
    ) {
        let mut limbs = Limbs::new();
        if is_worn {
            let (_, calibrated) = worn();
            limbs = calibrated;
        }
        let (mut time, mut cycle) = (0_u32, 0_u16);
        let body = body();
        for (place, [a, b, c, d, e, f], step, age, next) in packets {
            time = time.wrapping_add(step / 64);
            cycle = cycle.wrapping_add(next);
            let packet = Packet {
                segment: Segment::ALL[place],
                cycle,
                time,
                age,
                rates: [a, b, c],
                forces: [d, e, f],
            };
            limbs.next(&mut &packet.encode()[..], Some(&body));
            if let Some(posture) = limbs.posture() {
                prop_assert!(posture.is_valid());
            }
        }
    }
}
