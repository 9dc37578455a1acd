//! Sensors of arms that turn round in flight, which neither their attitude nor the range of a joint tells.

use bodyflight_core::Segment;
use bodyflight_core::math::rotation_by;
use bodyflight_laboratory::limb_sensors::Fault;
use bodyflight_mvnx::recording::FlightFrame;
use nalgebra::Vector3;

use super::suit_maneuvers::MANEUVERS;
use super::{flown, read, streams};

const ARMS: [Segment; 4] = [
    Segment::LeftUpperArm,
    Segment::LeftForearm,
    Segment::RightUpperArm,
    Segment::RightForearm,
];

/// What is said of ten sensors in a flight.
fn said(frames: &[FlightFrame], seed: u64, fault: Option<(Segment, Fault)>) -> Vec<String> {
    let streams = streams(frames, 10, seed, fault);
    read(&streams, &streams.mapping()).expect("a flight").doubts
}

/// Whether a sensor is said to have turned.
fn names(said: &[String], segment: Segment) -> bool {
    let name = segment.name();
    said.iter()
        .any(|said| said.contains(name) && said.contains("of the arc"))
}

/// The same flight with arms that swing out and back, another one each second.
fn swinging(frames: &[FlightFrame]) -> Vec<FlightFrame> {
    let swung = frames.iter().map(|frame| {
        let second = frame.time.floor();
        let out = (2.5 * (frame.time - second) * std::f64::consts::TAU * 0.5).sin();
        let share = if frame.time - second < 0.8 {
            out * out
        } else {
            0.0
        };
        let place = (0..ARMS.len()).find(|place| ((second - *place as f64) % 4.0).abs() < 0.5);
        let arm = ARMS[place.unwrap_or(0)];
        let bent =
            *frame.posture.parent_from_segment(arm) * rotation_by(&(Vector3::x() * (2.4 * share)));
        FlightFrame {
            posture: frame.posture.with(arm, bent),
            ..*frame
        }
    });
    swung.collect()
}

#[test]
fn a_sensor_of_an_arm_that_turns_round_in_flight_is_named() {
    for (place, arm) in ARMS.into_iter().enumerate() {
        let seed = 40 + place as u64;
        let mut frames = flown(MANEUVERS[2 * place], seed);
        frames.retain(|frame| frame.time < 5.0);
        let found = said(&frames, seed, Some((arm, Fault::Reversed(3.0, 0.3))));
        assert!(names(&found, arm), "{arm:?}: {found:?}");
    }
}

#[test]
fn arms_that_swing_fast_are_not_accused() {
    for seed in [50, 51] {
        let mut frames = flown("rotations", seed);
        frames.retain(|frame| frame.time < 9.0);
        let found = said(&swinging(&frames), seed, None);
        assert!(!ARMS.iter().any(|arm| names(&found, *arm)), "{found:?}");
    }
}

/// How often arms are named, by how long the turn takes, and how often without a fault.
#[test]
#[ignore = "takes half an hour of processor time; run it after a change of what tells arms"]
fn the_table_of_arms() {
    let number = |name: &str, usual: u64| {
        let given = std::env::var(name).ok();
        given.map_or(usual, |given| given.parse().expect("a number"))
    };
    let first = number("BODYFLIGHT_SUIT_FIRST", 7000);
    let count = number("BODYFLIGHT_SUIT_FLIGHTS", 22);
    let durations = [0.2, 0.3, 0.5, 1.0];
    let mut named = [[0_u64; 2]; 4];
    let (mut accused, mut accused_swinging) = (0, 0);
    for seed in first..first + count {
        let maneuver = MANEUVERS[usize::try_from(seed).expect("small") % MANEUVERS.len()];
        let frames = flown(maneuver, seed);
        let good = said(&frames, seed, None);
        if ARMS.iter().any(|arm| names(&good, *arm)) {
            accused += 1;
            println!("{maneuver} {seed}: accused: {good:?}");
        }
        let swung = said(&swinging(&frames), seed, None);
        if ARMS.iter().any(|arm| names(&swung, *arm)) {
            accused_swinging += 1;
            println!("{maneuver} {seed}, arms swing: accused: {swung:?}");
        }
        let short: Vec<_> = frames
            .into_iter()
            .filter(|frame| frame.time < 7.0)
            .collect();
        for (place, duration) in durations.into_iter().enumerate() {
            for (of, arms) in [[0, 2], [1, 3]].into_iter().enumerate() {
                let arm = ARMS[arms[usize::try_from(seed / 2 % 2).expect("small")]];
                let found = said(&short, seed, Some((arm, Fault::Reversed(3.0, duration))));
                let is_named = names(&found, arm);
                named[place][of] += u64::from(is_named);
                if !is_named {
                    println!("{maneuver} {seed} {arm:?} {duration}: {found:?}");
                }
            }
        }
    }
    for (duration, [upper, fore]) in durations.into_iter().zip(named) {
        println!("within {duration} s: {upper} upper arms and {fore} forearms of {count}");
    }
    println!(
        "accused without a fault: {accused} of {count}; if arms swing: {accused_swinging} of {count}"
    );
}
