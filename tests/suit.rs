//! Postures from raw sensors on the limbs, against the truth of simulated falls and of recordings.
#![expect(clippy::expect_used, reason = "tests may panic: that is how they fail")]

#[path = "suit/arms.rs"]
mod arms;
#[path = "suit/bars.rs"]
mod bars;
#[path = "suit/faults.rs"]
mod faults;
#[path = "suit/recorded.rs"]
mod recorded;
#[path = "suit/reference.rs"]
mod reference;
#[path = "suit_maneuvers.rs"]
mod suit_maneuvers;

use std::collections::BTreeMap;
use std::path::Path;

use bodyflight_core::maneuver::Maneuver;
use bodyflight_core::sensor_noise::SensorNoise;
use bodyflight_core::suit::fill::{Orientation, filled};
use bodyflight_core::suit::placement::{SETS, of_size};
use bodyflight_core::suit::strapdown::Reading;
use bodyflight_core::{Segment, SegmentArray};
use bodyflight_laboratory::limb_sensors::{Fault, LimbSensors, Sizes, Streams};
use bodyflight_laboratory::synthesize::{self, Request};
use bodyflight_mocap::imu::mapping::ImuMapping;
use bodyflight_mocap::imu::stream::Stream;
use bodyflight_mocap::imu::worn::{Worn, worn};
use bodyflight_mvnx::recording::{FlightFrame, Options};
use bodyflight_replay::flight::Flight;
use bodyflight_replay::frames::Frames;
use bodyflight_replay::subject::Subject;
use bodyflight_shared_data::shared;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// A flight without noise.
fn flown(name: &str, seed: u64) -> Vec<FlightFrame> {
    let subject = Subject::default();
    let flight = Flight::bare(Path::new(""));
    let maneuver = Maneuver::from_name(name).expect("a known maneuver");
    let request = Request {
        noise: SensorNoise::NONE,
        sway: 0.02,
        ..Request::new(maneuver, &subject, seed)
    };
    synthesize::flown(&request, &flight.dynamics(4000.0)).expect("a flight")
}

/// What the program makes of the sensors' readings.
fn read(streams: &Streams, mapping: &str) -> bodyflight_io::diagnostic::Result<Worn> {
    let mapping = ImuMapping::parse(mapping, Path::new("mapping.toml"))?;
    let sensors: Vec<(Segment, Stream)> = streams
        .sensors
        .iter()
        .map(|(segment, rows)| {
            let times = rows.iter().map(|row| row.0).collect();
            let readings = rows.iter().map(|(_, rate, force)| Reading {
                angular_velocity: *rate,
                specific_force: *force,
            });
            Ok((*segment, Stream::new(times, readings.collect())?))
        })
        .collect::<bodyflight_io::diagnostic::Result<_>>()?;
    let body = Subject::default().body();
    worn(&mapping, &sensors, &body, &mut |_| Ok(()))
}

/// Errors of a set over a flight, RMS (degrees): of the orientation about an axis by segment, its stated deviation, the
/// direction of all limbs relative to the pelvis, and the pelvis' tilt.
struct Errors {
    actual: BTreeMap<Segment, f64>,
    stated: BTreeMap<Segment, f64>,
    direction: f64,
    /// The same of the segments with a sensor.
    measured: f64,
    tilt: f64,
}

fn errors(worn: &Worn, frames: &[FlightFrame]) -> Errors {
    let mut squares = BTreeMap::new();
    let (mut directions, mut measured, mut tilts) = (0.0, 0.0, 0.0);
    let (mut count, mut seen_count) = (0.0, 0.0_f64);
    let limbs = Segment::ALL.into_iter().skip(1);
    for (time, seen) in &worn.frames {
        let Some(truth) = frames.iter().rev().find(|frame| frame.time <= time + 1e-6) else {
            continue;
        };
        count += 1.0;
        let true_segments = truth.posture.body_from_segments();
        for segment in limbs.clone() {
            let found = seen.orientations[segment].body_from_segment;
            let off = found * true_segments[segment].inverse();
            *squares.entry(segment).or_insert(0.0) += off.scaled_axis().norm_squared() / 3.0;
            let along = Vector3::z();
            let angle = (found * along).angle(&(true_segments[segment] * along));
            directions += angle * angle / 15.0;
            if seen.orientations[segment].is_measured {
                measured += angle * angle;
                seen_count += 1.0;
            }
        }
        let up = |attitude: &UnitQuaternion<f64>| attitude.inverse() * Vector3::z();
        let found = up(seen.inertial_from_body.quaternion());
        tilts += found
            .angle(&up(truth.pelvis.inertial_from_body.quaternion()))
            .powi(2);
    }
    let root = |square: f64| (square / count).sqrt().to_degrees();
    Errors {
        actual: squares
            .iter()
            .map(|(s, square)| (*s, root(*square)))
            .collect(),
        stated: limbs.map(|s| (s, worn.deviation[s].to_degrees())).collect(),
        direction: root(directions),
        measured: root(measured * count / seen_count.max(1.0)),
        tilt: root(tilts),
    }
}

/// The sensors of a set in a flight, by the errors of a seed.
fn streams(
    frames: &[FlightFrame],
    count: usize,
    seed: u64,
    fault: Option<(Segment, Fault)>,
) -> Streams {
    let sensors = LimbSensors {
        seed,
        segments: of_size(count).expect("a set"),
        sizes: Sizes::TYPICAL,
        fault,
    };
    sensors.of(&Subject::default().body(), frames)
}

/// A set over a flight: what is read, and its errors.
fn followed(
    frames: &[FlightFrame],
    count: usize,
    seed: u64,
    fault: Option<(Segment, Fault)>,
) -> (Worn, Errors) {
    let streams = streams(frames, count, seed, fault);
    let worn = read(&streams, &streams.mapping()).expect("a calibrated set");
    let errors = errors(&worn, frames);
    (worn, errors)
}

/// Root mean square.
fn root(values: impl Iterator<Item = f64>) -> f64 {
    let squares: Vec<f64> = values.map(|value| value * value).collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn postures_in_simulated_falls_are_as_close_as_stated() {
    let (mut actual, mut stated) = (Vec::new(), Vec::new());
    for (name, count, seed, direction) in [
        ("transitions", 10, 1, 9.5),
        ("aggressive-turns", 10, 2, 9.5),
        ("aggressive-turns", 8, 3, 11.5),
    ] {
        let frames = flown(name, seed);
        let (worn, found) = followed(&frames, count, seed, None);
        assert!(worn.doubts.is_empty(), "{name}: {:?}", worn.doubts);
        assert!(
            found.direction < direction,
            "{name}, {count}: {}",
            found.direction
        );
        assert!(
            found.tilt < 6.0,
            "{name}: the pelvis is off by {}",
            found.tilt
        );
        for segment in of_size(count).expect("a set").iter().skip(1) {
            actual.push(found.actual[segment]);
            stated.push(found.stated[segment]);
        }
    }
    let ratio = root(actual.into_iter()) / root(stated.into_iter());
    assert!(
        (0.7..1.3).contains(&ratio),
        "actual against stated: {ratio}"
    );
}

/// The postures of two real twisting somersaults.
fn somersaults() -> Option<Vec<Vec<FlightFrame>>> {
    let folder = shared("data")?.join("acrobatics");
    let read = |name: &str| {
        let frames = Frames::open(&folder.join(name), None, Options::default());
        let frames = frames.expect("a recording").collect::<Result<_, _>>();
        frames.expect("frames")
    };
    Some(
        ["Do_44_mvtPrep_1.mvnx", "Do_44_mvtPrep_3.mvnx"]
            .map(read)
            .into(),
    )
}

#[test]
fn ten_sensors_follow_a_real_somersault() {
    let Some(flights) = somersaults() else { return };
    let mut directions = Vec::new();
    for (frames, seed) in flights.iter().zip(1..) {
        let (worn, found) = followed(frames, 10, seed, None);
        assert!(worn.doubts.is_empty(), "{:?}", worn.doubts);
        directions.push(found.measured);
    }
    let direction = root(directions.into_iter());
    assert!(direction < 12.0, "{direction}");
}

/// What the rules for missing segments cost in the real postures, and what they state, degrees.
#[test]
fn missing_segments_of_real_postures_are_as_uncertain_as_stated() {
    let Some(flights) = somersaults() else { return };
    for set in SETS {
        let (mut off, mut stated, mut directions) = (Vec::new(), Vec::new(), Vec::new());
        for frame in flights.iter().flatten().step_by(5) {
            let truth = frame.posture.body_from_segments();
            let measured = SegmentArray::from_fn(|segment| {
                set.contains(&segment).then(|| Orientation {
                    body_from_segment: truth[segment],
                    covariance: Matrix3::zeros(),
                    is_measured: true,
                })
            });
            for (segment, found) in filled(&measured).iter() {
                let way = |turn: &UnitQuaternion<f64>| turn * Vector3::z();
                let angle = way(&found.body_from_segment).angle(&way(&truth[segment]));
                directions.push(angle.to_degrees());
                if !found.is_measured {
                    let turn = found.body_from_segment.angle_to(&truth[segment]);
                    off.push(turn.to_degrees() / 3.0_f64.sqrt());
                    stated.push(found.deviation().to_degrees());
                }
            }
        }
        let direction = root(directions.into_iter());
        if set.len() == Segment::ALL.len() {
            assert!(direction < 1e-6, "nothing is missing: {direction}");
            continue;
        }
        let ratio = root(off.into_iter()) / root(stated.into_iter());
        assert!(
            (0.7..1.5).contains(&ratio),
            "{}: {ratio}, {direction}",
            set.len()
        );
    }
}

/// A calibration that was not given is found; a bend that is missing, and a person who moves, are refused.
#[test]
fn calibrations_are_found_or_refused() {
    let mut frames = flown("rotations", 5);
    frames.retain(|frame| frame.time < 4.0);
    let streams = streams(&frames, 8, 5, None);
    let mapping = streams.mapping();
    let without = |name: &str| -> String {
        let lines = mapping.lines().filter(|line| !line.starts_with(name));
        lines.map(|line| format!("{line}\n")).collect()
    };
    let given = read(&streams, &mapping).expect("as given");
    let mut text = mapping.clone();
    for name in ["tray_s", "upright_s", "bent_s", "march_s"] {
        text = text
            .lines()
            .filter(|l| !l.starts_with(name))
            .map(|l| format!("{l}\n"))
            .collect();
    }
    let found = read(&streams, &text).expect("found");
    assert!(
        found
            .notes
            .iter()
            .any(|note| note.contains("calibration found")),
        "{:?}",
        found.notes
    );
    let (given, found) = (errors(&given, &frames), errors(&found, &frames));
    assert!(
        (found.direction - given.direction).abs() < 2.0,
        "{} {}",
        found.direction,
        given.direction
    );
    for (name, wrong, parts) in [
        (
            "upright_s",
            "upright_s = [53.0, 56.0]\n",
            ["upright_s", "expected rest"],
        ),
        ("march_s", "", ["upperarm", "neither leaned"]),
        (
            "turns_s",
            "turns_s = [[10.0, 14.2]]\n",
            ["turns_s", "turns"],
        ),
    ] {
        let text = without(name).replace("[calibration]\n", &format!("[calibration]\n{wrong}"));
        let said = read(&streams, &text).err().expect("a refusal").to_string();
        assert!(
            parts.iter().all(|part| said.contains(part)),
            "{name}: {said}"
        );
    }
}
